//! The scalar of a model: a number or a dual number.

use num_dual::{DualNum, DualSVec64};

/// Scalar of a model: `f64`, or a dual number that carries derivatives along.
///
/// Write models over `T: Scalar` and Truing evaluates them with plain numbers or differentiates
/// them. This trait is the one place that names `num-dual`; it is implemented for every `Copy`
/// dual number over `f64`. Functions such as [`sin`](DualNum::sin) or [`sqrt`](DualNum::sqrt)
/// come from [`num_dual::DualNum`]; the plain value is [`value`].
///
/// Two traps when a model passes through a singular point: `sqrt` has an infinite derivative at
/// zero (avoid norms of vectors that vanish; see [`crate::manifold::so3`] for functions of the
/// squared angle that do not), and comparisons look at the real part only.
pub trait Scalar: DualNum<Primitive = f64> + Copy + Send + Sync {}

impl<T: DualNum<Primitive = f64> + Copy + Send + Sync> Scalar for T {}

/// A dual number with `N` partial derivatives, on the stack.
pub type Dual<const N: usize> = DualSVec64<N>;

/// The plain value of a scalar, its derivatives dropped.
#[inline]
pub fn value<T: Scalar>(x: T) -> f64 {
    x.re()
}
