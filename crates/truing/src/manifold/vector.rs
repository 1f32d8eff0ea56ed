//! Plain vectors of any length.

use crate::scalar::Scalar;
use crate::variable::Variable;

/// A vector of any fixed length n; x ⊞ δ = x + δ.
///
/// A constraint sees `&[T]`. Robot parameters, biases and the unknowns of a curve fit are vectors.
#[derive(Debug, Clone, Copy)]
pub struct Vector;

impl Variable for Vector {
    const FLAT: bool = true;

    type Value = Vec<f64>;
    type View<'a, T: Scalar> = &'a [T];

    fn view<T: Scalar>(x: &[T]) -> &[T] {
        x
    }

    fn plus<T: Scalar>(x: &[f64], delta: &[T], out: &mut [T]) {
        for ((o, d), x) in out.iter_mut().zip(delta).zip(x) {
            *o = *d + *x;
        }
    }

    fn minus<T: Scalar>(x: &[T], origin: &[f64], out: &mut [T]) {
        for ((o, x), origin) in out.iter_mut().zip(x).zip(origin) {
            *o = *x - *origin;
        }
    }

    fn tangent_dim(ambient_dim: usize) -> usize {
        ambient_dim
    }

    fn store(value: &Vec<f64>) -> Vec<f64> {
        value.clone()
    }

    fn load(x: &[f64]) -> Vec<f64> {
        x.to_vec()
    }
}
