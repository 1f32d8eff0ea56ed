//! How joints move.

use crate::text::quantity::Dimension;

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum JointKind {
    /// It turns about z.
    Revolute,
    /// It slides along z.
    Prismatic,
    /// It does not move: a frame and no more.
    Fixed,
}

impl JointKind {
    pub(crate) const NAMES: [&str; 3] = ["revolute", "prismatic", "fixed"];

    /// The name of the kind in robot files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
            Self::Fixed => "fixed",
        }
    }

    /// What the position of the joint measures; nothing for a fixed one.
    #[must_use]
    pub fn dimension(self) -> Dimension {
        match self {
            Self::Revolute => Dimension::Angle,
            Self::Prismatic => Dimension::Length,
            Self::Fixed => Dimension::None,
        }
    }
}
