//! A frame of a robot file: its parameters and the convention that gives them meaning.

use crate::text::quantity::Dimension;
use truing::nalgebra::Vector3;

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
    /// A constant transform, a small one with six parameters, and the motion of the joint about or along any
    /// axis, as URDF has it: Trans(xyz) · Rpy(rpy) · Trans(x, y, z) · Rpy(rx, ry, rz) · motion.
    General,
}

impl Convention {
    pub(super) const NAMES: [(&str, Self); 8] = [
        ("general", Self::General),
        ("urdf", Self::General),
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
            Self::General => "general",
        }
    }

    /// The parameters of a frame; those after the fourth are written only if they are not 0.
    pub(super) fn keys(self, part: Part) -> &'static [Key] {
        match (self, part) {
            (Self::KhalilKleinfinger, Part::Base) => &[Key::Theta, Key::R],
            (Self::KhalilKleinfinger, _) => &[Key::Alpha, Key::D, Key::Theta, Key::R, Key::Beta],
            (Self::DenavitHartenberg, _) => &[Key::Theta, Key::D, Key::A, Key::Alpha, Key::Beta],
            (Self::General, _) => &Key::SMALL,
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
    X,
    Y,
    Z,
    Rx,
    Ry,
    Rz,
}

impl Key {
    /// The small transform of a general frame.
    pub(super) const SMALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::Rx, Self::Ry, Self::Rz];

    pub(super) const ALL: [Self; 12] = [
        Self::Alpha,
        Self::D,
        Self::Theta,
        Self::R,
        Self::Beta,
        Self::A,
        Self::X,
        Self::Y,
        Self::Z,
        Self::Rx,
        Self::Ry,
        Self::Rz,
    ];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Alpha => "alpha",
            Self::D => "d",
            Self::Theta => "theta",
            Self::R => "r",
            Self::Beta => "beta",
            Self::A => "a",
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
            Self::Rx => "rx",
            Self::Ry => "ry",
            Self::Rz => "rz",
        }
    }

    pub(super) fn dimension(self) -> Dimension {
        match self {
            Self::Alpha | Self::Theta | Self::Beta | Self::Rx | Self::Ry | Self::Rz => {
                Dimension::Angle
            }
            _ => Dimension::Length,
        }
    }
}

/// A general frame: what is constant in it, and its small transform.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GeneralFrame {
    /// Constant translation \[m\].
    pub xyz: [f64; 3],
    /// Constant rotation: roll, pitch and yaw about fixed axes \[rad\].
    pub rpy: [f64; 3],
    /// The axis of the joint, in the frame; not zero.
    pub axis: [f64; 3],
    /// The small transform: x, y, z \[m\], then roll, pitch and yaw about fixed axes \[rad\].
    pub small: [f64; 6],
}

impl GeneralFrame {
    /// The unit axis of the joint.
    pub fn axis(&self) -> Vector3<f64> {
        let axis = Vector3::from(self.axis);
        axis.try_normalize(0.0).unwrap_or_else(Vector3::z)
    }
}

impl Default for GeneralFrame {
    fn default() -> Self {
        Self {
            xyz: [0.0; 3],
            rpy: [0.0; 3],
            axis: [0.0, 0.0, 1.0],
            small: [0.0; 6],
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
    /// A general frame.
    pub general: GeneralFrame,
    /// The convention of this frame, where it is not the robot's.
    pub convention: Option<Convention>,
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
            small => self.general.small[small as usize - Key::X as usize],
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
            small => &mut self.general.small[small as usize - Key::X as usize],
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
        for convention in [
            Convention::KhalilKleinfinger,
            Convention::DenavitHartenberg,
            Convention::General,
        ] {
            assert!(Convention::NAMES.contains(&(convention.name(), convention)));
        }
    }
}
