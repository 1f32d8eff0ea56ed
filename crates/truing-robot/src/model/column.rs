//! Columns of the Jacobian, and whose they are.

use crate::unknown::{Own, Role};

/// Whose column of the Jacobian it is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Owner {
    /// Parameter of a robot.
    Parameter {
        /// The robot.
        robot: usize,
        /// The parameter.
        parameter: usize,
    },
    /// Component of a sensor frame.
    Frame(String),
    /// Component of a tool point, or of a body on the tool: robot, name.
    Target(usize, String),
    /// Component of an unknown of a set.
    Own {
        /// Whose it is.
        own: Own,
        /// What it is there for.
        role: Role,
        /// Whether its rows only compare tools with each other.
        compares: bool,
    },
    /// Never estimated: the reference frame, the tool origin, a known distance.
    Constant,
}

impl Owner {
    /// Whether it belongs to what was touched or visited, and to no robot or instrument.
    pub fn is_local(&self) -> bool {
        matches!(
            self,
            Self::Own {
                role: Role::Place,
                ..
            }
        )
    }
}

/// A column of the Jacobian.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Whose it is.
    pub owner: Owner,
    /// Name, e.g. `left.theta3`, `tracker.x`, `wall.distance`.
    pub name: String,
}
