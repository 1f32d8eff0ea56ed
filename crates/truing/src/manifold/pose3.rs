//! Rigid motions in space.

use super::Rotation3;
use super::so3;
use crate::scalar::{Scalar, value};
use crate::variable::Variable;
use nalgebra::{Matrix3, Vector3};

/// A rigid motion: x_parent = rotation · x_child + translation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose<T> {
    /// Rotation matrix (3 × 3).
    pub rotation: Matrix3<T>,
    /// Translation \[m\].
    pub translation: Vector3<T>,
}

impl<T: Scalar> Pose<T> {
    /// The motion that moves nothing.
    pub fn identity() -> Self {
        Self {
            rotation: Matrix3::identity(),
            translation: Vector3::new(T::zero(), T::zero(), T::zero()),
        }
    }

    /// The motion with the given rotation and translation.
    pub fn new(rotation: Matrix3<T>, translation: Vector3<T>) -> Self {
        Self {
            rotation,
            translation,
        }
    }

    /// self ∘ other: first `other`, then `self`.
    #[must_use]
    pub fn compose(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation * other.rotation,
            translation: self.apply(&other.translation),
        }
    }

    /// The image of a point.
    pub fn apply(&self, point: &Vector3<T>) -> Vector3<T> {
        self.rotation * point + self.translation
    }

    /// The inverse motion.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self {
            rotation,
            translation: -(rotation * self.translation),
        }
    }

    /// The same motion with its derivatives dropped.
    pub fn to_f64(&self) -> Pose<f64> {
        Pose {
            rotation: self.rotation.map(value),
            translation: self.translation.map(value),
        }
    }
}

impl Pose<f64> {
    /// The same motion as a constant of another scalar type.
    pub fn lift<T: Scalar>(&self) -> Pose<T> {
        Pose {
            rotation: self.rotation.map(T::from),
            translation: self.translation.map(T::from),
        }
    }

    /// From a translation \[m\] and a unit quaternion (w, x, y, z).
    pub fn from_quaternion(translation: Vector3<f64>, q: [f64; 4]) -> Self {
        Self {
            rotation: so3::quaternion_matrix(&q),
            translation,
        }
    }

    /// The rotation as a unit quaternion (w, x, y, z).
    pub fn quaternion(&self) -> [f64; 4] {
        so3::matrix_quaternion(&self.rotation)
    }
}

/// A pose, stored as (x, y, z, qw, qx, qy, qz); t ⊞ δt = t + δt \[m\] and R ⊞ ω = R · exp(ω) \[rad\].
///
/// The six degrees of freedom are (translation; rotation). A constraint sees a [`Pose`].
#[derive(Debug, Clone, Copy)]
pub struct Pose3;

impl Variable for Pose3 {
    type Value = Pose<f64>;
    type View<'a, T: Scalar> = Pose<T>;

    fn view<T: Scalar>(x: &[T]) -> Pose<T> {
        Pose {
            rotation: so3::quaternion_matrix(&x[3..7]),
            translation: Vector3::new(x[0], x[1], x[2]),
        }
    }

    fn plus<T: Scalar>(x: &[f64], delta: &[T], out: &mut [T]) {
        for i in 0..3 {
            out[i] = delta[i] + x[i];
        }
        Rotation3::plus(&x[3..7], &delta[3..6], &mut out[3..7]);
    }

    fn minus<T: Scalar>(x: &[T], origin: &[f64], out: &mut [T]) {
        for i in 0..3 {
            out[i] = x[i] - origin[i];
        }
        Rotation3::minus(&x[3..7], &origin[3..7], &mut out[3..6]);
    }

    fn tangent_dim(_: usize) -> usize {
        6
    }

    fn store(value: &Pose<f64>) -> Vec<f64> {
        let mut x = value.translation.as_slice().to_vec();
        x.extend(value.quaternion());
        x
    }

    fn load(x: &[f64]) -> Pose<f64> {
        Self::view(x)
    }
}
