//! Points in space.

use crate::scalar::Scalar;
use crate::variable::Variable;
use nalgebra::Vector3;

/// A point in space, (x, y, z) \[m\]; x ⊞ δ = x + δ.
#[derive(Debug, Clone, Copy)]
pub struct Point3;

impl Variable for Point3 {
    const FLAT: bool = true;

    type Value = Vector3<f64>;
    type View<'a, T: Scalar> = Vector3<T>;

    fn view<T: Scalar>(x: &[T]) -> Vector3<T> {
        Vector3::new(x[0], x[1], x[2])
    }

    fn plus<T: Scalar>(x: &[f64], delta: &[T], out: &mut [T]) {
        for i in 0..3 {
            out[i] = delta[i] + x[i];
        }
    }

    fn minus<T: Scalar>(x: &[T], origin: &[f64], out: &mut [T]) {
        for i in 0..3 {
            out[i] = x[i] - origin[i];
        }
    }

    fn tangent_dim(_: usize) -> usize {
        3
    }

    fn store(value: &Vector3<f64>) -> Vec<f64> {
        value.as_slice().to_vec()
    }

    fn load(x: &[f64]) -> Vector3<f64> {
        Self::view(x)
    }
}
