//! Rigid motions in the plane.

use crate::scalar::{Scalar, value};
use crate::variable::Variable;
use nalgebra::Vector2;

/// A rigid motion of the plane: a rotation by `angle` \[rad\], then `translation` \[m\].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarPose<T> {
    /// Translation \[m\].
    pub translation: Vector2<T>,
    /// Rotation angle \[rad\].
    pub angle: T,
}

/// A pose in the plane, stored as (x, y, θ); ⊞ adds, and θ is kept in (−π, π].
///
/// A constraint sees a [`PlanarPose`]. Three degrees of freedom [m, m, rad].
#[derive(Debug, Clone, Copy)]
pub struct Pose2;

/// Adds the multiple of 2π that brings the plain value into (−π, π]; derivatives stay.
fn wrap<T: Scalar>(angle: T) -> T {
    use std::f64::consts::{PI, TAU};
    let turns = ((value(angle) - PI) / TAU).ceil();
    if turns == 0.0 {
        angle
    } else {
        angle - turns * TAU
    }
}

impl Variable for Pose2 {
    type Value = PlanarPose<f64>;
    type View<'a, T: Scalar> = PlanarPose<T>;

    fn view<T: Scalar>(x: &[T]) -> PlanarPose<T> {
        PlanarPose {
            translation: Vector2::new(x[0], x[1]),
            angle: x[2],
        }
    }

    fn plus<T: Scalar>(x: &[f64], delta: &[T], out: &mut [T]) {
        out[0] = delta[0] + x[0];
        out[1] = delta[1] + x[1];
        out[2] = wrap(delta[2] + x[2]);
    }

    fn minus<T: Scalar>(x: &[T], origin: &[f64], out: &mut [T]) {
        out[0] = x[0] - origin[0];
        out[1] = x[1] - origin[1];
        out[2] = wrap(x[2] - origin[2]);
    }

    fn tangent_dim(_: usize) -> usize {
        3
    }

    fn store(value: &PlanarPose<f64>) -> Vec<f64> {
        vec![value.translation.x, value.translation.y, wrap(value.angle)]
    }

    fn load(x: &[f64]) -> PlanarPose<f64> {
        Self::view(x)
    }
}
