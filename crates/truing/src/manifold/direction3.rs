//! Directions: points on the unit sphere.

use super::so3;
use crate::scalar::{Scalar, value};
use crate::variable::Variable;
use nalgebra::{Matrix3x2, Vector3};

/// A direction in space, a unit vector; n ⊞ δ = cos|δ| n + sinc|δ| B(n) δ, two degrees of freedom \[rad\].
///
/// B(n) (3 × 2) is an orthonormal basis of the plane across n. A constraint sees the unit vector.
#[derive(Debug, Clone, Copy)]
pub struct Direction3;

impl Direction3 {
    /// An orthonormal basis (3 × 2) of the plane across the unit vector `n`, continuous in `n`
    /// except at n = (0, 0, −1): the images of x and y under the reflection that takes z to −n (Frisvad 2012,
    /// "Building an orthonormal basis from a 3D vector without normalization"), with 1 + n_z in a form that does not
    /// cancel below the equator.
    pub fn basis(n: &[f64]) -> Matrix3x2<f64> {
        let across = n[0] * n[0] + n[1] * n[1];
        let a = if n[2] >= 0.0 {
            -1.0 / (1.0 + n[2])
        } else if across > 0.0 {
            -(1.0 - n[2]) / across
        } else {
            return Matrix3x2::new(1.0, 0.0, 0.0, -1.0, 0.0, 0.0);
        };
        let b = n[0] * n[1] * a;
        Matrix3x2::new(
            1.0 + n[0] * n[0] * a,
            b,
            b,
            1.0 + n[1] * n[1] * a,
            -n[0],
            -n[1],
        )
    }
}

impl Variable for Direction3 {
    type Value = Vector3<f64>;
    type View<'a, T: Scalar> = Vector3<T>;

    fn view<T: Scalar>(x: &[T]) -> Vector3<T> {
        Vector3::new(x[0], x[1], x[2])
    }

    fn plus<T: Scalar>(x: &[f64], delta: &[T], out: &mut [T]) {
        let basis = Self::basis(x);
        let s = delta[0] * delta[0] + delta[1] * delta[1];
        let (cos, sinc) = (so3::cosine(s), so3::sinc(s));
        for i in 0..3 {
            out[i] = cos * x[i] + (delta[0] * basis[(i, 0)] + delta[1] * basis[(i, 1)]) * sinc;
        }
        let norm = (out[0] * out[0] + out[1] * out[1] + out[2] * out[2]).sqrt();
        for o in &mut out[..3] {
            *o /= norm;
        }
    }

    fn minus<T: Scalar>(x: &[T], origin: &[f64], out: &mut [T]) {
        let basis = Self::basis(origin);
        let across: [T; 2] = std::array::from_fn(|k| {
            x[0] * basis[(0, k)] + x[1] * basis[(1, k)] + x[2] * basis[(2, k)]
        });
        let along = x[0] * origin[0] + x[1] * origin[1] + x[2] * origin[2];
        let s = across[0] * across[0] + across[1] * across[1];
        // Straight behind the origin every way round is shortest; take the first basis vector.
        if value(s) == 0.0 && value(along) < 0.0 {
            out[0] = T::from(std::f64::consts::PI);
            out[1] = T::zero();
            return;
        }
        let scale = so3::angle_over_sine(s, along);
        out[0] = across[0] * scale;
        out[1] = across[1] * scale;
    }

    fn tangent_dim(_: usize) -> usize {
        2
    }

    fn store(value: &Vector3<f64>) -> Vec<f64> {
        let norm = value.norm();
        assert!(
            norm > 0.0 && norm.is_finite(),
            "a direction needs a finite vector that is not zero, found {value:?}"
        );
        (value / norm).as_slice().to_vec()
    }

    fn load(x: &[f64]) -> Vector3<f64> {
        Self::view(x)
    }
}
