//! Planes: unit normal and distance.

use super::Direction3;
use crate::scalar::Scalar;
use crate::variable::Variable;
use nalgebra::Vector3;

/// A plane: the points p with normal · p = distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane<T> {
    /// Unit normal.
    pub normal: Vector3<T>,
    /// Signed distance of the plane from the origin along the normal \[m\].
    pub distance: T,
}

impl<T: Scalar> Plane<T> {
    /// Signed distance of a point from the plane \[m\], positive on the side the normal points to.
    pub fn signed_distance(&self, point: &Vector3<T>) -> T {
        self.normal.x * point.x + self.normal.y * point.y + self.normal.z * point.z - self.distance
    }
}

/// A plane, stored as (nx, ny, nz, d); the normal moves as a [`Direction3`], the distance adds.
///
/// Three degrees of freedom (rad, rad, m). Unlike a·x + b·y + c·z + 1 = 0 it can pass through the
/// origin, and it has no minimum at infinity. A constraint sees a [`Plane`].
#[derive(Debug, Clone, Copy)]
pub struct Plane3;

impl Variable for Plane3 {
    type Value = Plane<f64>;
    type View<'a, T: Scalar> = Plane<T>;

    fn view<T: Scalar>(x: &[T]) -> Plane<T> {
        Plane {
            normal: Vector3::new(x[0], x[1], x[2]),
            distance: x[3],
        }
    }

    fn plus<T: Scalar>(x: &[f64], delta: &[T], out: &mut [T]) {
        Direction3::plus(&x[..3], &delta[..2], &mut out[..3]);
        out[3] = delta[2] + x[3];
    }

    fn minus<T: Scalar>(x: &[T], origin: &[f64], out: &mut [T]) {
        Direction3::minus(&x[..3], &origin[..3], &mut out[..2]);
        out[2] = x[3] - origin[3];
    }

    fn tangent_dim(_: usize) -> usize {
        3
    }

    fn store(value: &Plane<f64>) -> Vec<f64> {
        let mut x = Direction3::store(&value.normal);
        x.push(value.distance / value.normal.norm());
        x
    }

    fn load(x: &[f64]) -> Plane<f64> {
        Self::view(x)
    }
}
