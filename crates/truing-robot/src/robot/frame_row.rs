//! A frame of a robot file: its parameters and the convention that gives them meaning.

use crate::text::quantity::Dimension;

/// What the parameters of a frame mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Convention {
    /// Khalil–Kleinfinger (modified Denavit–Hartenberg), with an extra angle for near-parallel axes:
    /// Rot(y, β) · Rot(x, α) · Trans(x, d) · Rot(z, θ) · Trans(z, r)
    /// (Khalil & Kleinfinger 1986).
    KhalilKleinfinger,
    /// Distal Denavit–Hartenberg, with an extra angle for near-parallel axes:
    /// Rot(z, θ) · Trans(z, d) · Trans(x, a) · Rot(x, α) · Rot(y, β)
    /// (Denavit & Hartenberg 1955; β as in Hayati 1983).
    DenavitHartenberg,
}

impl Convention {
    pub(super) const NAMES: [(&str, Self); 6] = [
        ("khalil-kleinfinger", Self::KhalilKleinfinger),
        ("denavit-hartenberg", Self::DenavitHartenberg),
        ("kk", Self::KhalilKleinfinger),
        ("modified-dh", Self::KhalilKleinfinger),
        ("dh", Self::DenavitHartenberg),
        ("distal-dh", Self::DenavitHartenberg),
    ];

    /// The name of the convention in robot files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::KhalilKleinfinger => "khalil-kleinfinger",
            Self::DenavitHartenberg => "denavit-hartenberg",
        }
    }

    /// The parameters of a frame; those after the fourth are written only if they are not 0.
    pub(super) fn keys(self, part: Part) -> &'static [Key] {
        match (self, part) {
            (Self::KhalilKleinfinger, Part::Base) => &[Key::Theta, Key::R],
            (Self::KhalilKleinfinger, _) => &[Key::Alpha, Key::D, Key::Theta, Key::R, Key::Beta],
            (Self::DenavitHartenberg, _) => &[Key::Theta, Key::D, Key::A, Key::Alpha, Key::Beta],
        }
    }
}

/// The part of the robot a frame belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Base,
    Joint,
    Tool,
}

/// A parameter of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Key {
    Alpha,
    D,
    Theta,
    R,
    Beta,
    A,
}

impl Key {
    pub(super) const ALL: [Self; 6] = [
        Self::Alpha,
        Self::D,
        Self::Theta,
        Self::R,
        Self::Beta,
        Self::A,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Alpha => "alpha",
            Self::D => "d",
            Self::Theta => "theta",
            Self::R => "r",
            Self::Beta => "beta",
            Self::A => "a",
        }
    }

    pub(super) fn dimension(self) -> Dimension {
        match self {
            Self::Alpha | Self::Theta | Self::Beta => Dimension::Angle,
            Self::D | Self::R | Self::A => Dimension::Length,
        }
    }
}

/// The parameters of a frame; those the convention does not have are 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FrameRow {
    /// Rotation about x \[rad\].
    pub alpha: f64,
    /// Translation along x (Khalil–Kleinfinger) or along z (Denavit–Hartenberg) \[m\].
    pub d: f64,
    /// Rotation about z \[rad\]; for a revolute joint, the offset.
    pub theta: f64,
    /// Translation along z, Khalil–Kleinfinger only \[m\]; for a prismatic joint, the offset.
    pub r: f64,
    /// Rotation about y \[rad\].
    pub beta: f64,
    /// Translation along x, Denavit–Hartenberg only \[m\].
    pub a: f64,
}

impl FrameRow {
    pub(super) fn get(&self, key: Key) -> f64 {
        match key {
            Key::Alpha => self.alpha,
            Key::D => self.d,
            Key::Theta => self.theta,
            Key::R => self.r,
            Key::Beta => self.beta,
            Key::A => self.a,
        }
    }

    pub(super) fn get_mut(&mut self, key: Key) -> &mut f64 {
        match key {
            Key::Alpha => &mut self.alpha,
            Key::D => &mut self.d,
            Key::Theta => &mut self.theta,
            Key::R => &mut self.r,
            Key::Beta => &mut self.beta,
            Key::A => &mut self.a,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_has_its_own_place() {
        let mut row = FrameRow::default();
        for (value, key) in (1..).map(f64::from).zip(Key::ALL) {
            *row.get_mut(key) = value;
        }
        for (value, key) in (1..).map(f64::from).zip(Key::ALL) {
            assert_eq!(row.get(key), value, "{}", key.name());
        }
    }

    #[test]
    fn a_convention_is_found_by_its_name() {
        for convention in [Convention::KhalilKleinfinger, Convention::DenavitHartenberg] {
            assert!(Convention::NAMES.contains(&(convention.name(), convention)));
        }
    }
}
