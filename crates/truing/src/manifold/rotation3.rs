//! Rotations in space.

use super::so3;
use crate::scalar::Scalar;
use crate::variable::Variable;
use nalgebra::Matrix3;

/// A rotation, stored as a unit quaternion (w, x, y, z); R ⊞ ω = R · exp(ω), three degrees of freedom \[rad\].
///
/// A constraint sees the rotation matrix (3 × 3).
#[derive(Debug, Clone, Copy)]
pub struct Rotation3;

impl Variable for Rotation3 {
    type Value = Matrix3<f64>;
    type View<'a, T: Scalar> = Matrix3<T>;

    fn view<T: Scalar>(x: &[T]) -> Matrix3<T> {
        so3::quaternion_matrix(x)
    }

    fn plus<T: Scalar>(x: &[f64], delta: &[T], out: &mut [T]) {
        let q = [T::from(x[0]), T::from(x[1]), T::from(x[2]), T::from(x[3])];
        let product = so3::quaternion_product(&q, &so3::exp_quaternion(delta));
        let s = product.iter().fold(T::zero(), |s, c| s + *c * *c);
        let scale = s.sqrt().recip();
        for i in 0..4 {
            out[i] = product[i] * scale;
        }
    }

    fn minus<T: Scalar>(x: &[T], origin: &[f64], out: &mut [T]) {
        let inverse = [
            T::from(origin[0]),
            T::from(-origin[1]),
            T::from(-origin[2]),
            T::from(-origin[3]),
        ];
        let log = so3::log_quaternion(&so3::quaternion_product(&inverse, x));
        out[..3].copy_from_slice(log.as_slice());
    }

    fn tangent_dim(_: usize) -> usize {
        3
    }

    fn store(value: &Matrix3<f64>) -> Vec<f64> {
        so3::matrix_quaternion(value).to_vec()
    }

    fn load(x: &[f64]) -> Matrix3<f64> {
        Self::view(x)
    }
}
