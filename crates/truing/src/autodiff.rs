//! Chunked forward-mode automatic differentiation on `num-dual`.

use crate::constraint::{Constraint, Jacobian, Point};
use crate::scalar::{Dual, value};
use crate::variable::{MAX_VARS, Vars};
use nalgebra::{Const, SVector};
use num_dual::Derivative;
use std::any::{Any, TypeId};

/// Memory kept between evaluations: dual numbers and whatever hand-written Jacobians ask for.
#[derive(Default)]
pub struct Scratch {
    memories: Vec<(TypeId, Box<dyn Any + Send>)>,
    /// Row-major panels handed to constraints.
    pub(crate) panel: Vec<f64>,
}

impl Scratch {
    pub(crate) fn memory<M: Default + Send + 'static>(&mut self) -> &mut M {
        let id = TypeId::of::<M>();
        let at = match self.memories.iter().position(|(kind, _)| *kind == id) {
            Some(at) => at,
            None => {
                self.memories.push((id, Box::<M>::default()));
                self.memories.len() - 1
            }
        };
        match self.memories[at].1.downcast_mut() {
            Some(memory) => memory,
            None => unreachable!("memories are filed under their own type"),
        }
    }
}

struct Buffers<const N: usize> {
    ambient: Vec<Dual<N>>,
    delta: Vec<Dual<N>>,
    residual: Vec<Dual<N>>,
}

impl<const N: usize> Default for Buffers<N> {
    fn default() -> Self {
        Self {
            ambient: Vec::new(),
            delta: Vec::new(),
            residual: Vec::new(),
        }
    }
}

/// A dual number with value `x` whose partial derivative number `k` is one.
#[inline]
pub fn seed<const N: usize>(x: f64, k: usize) -> Dual<N> {
    let mut eps = SVector::<f64, N>::zeros();
    eps[k] = 1.0;
    Dual::new(x, Derivative::some(eps))
}

/// The partial derivatives of a dual number.
#[inline]
pub fn partials<const N: usize>(x: &Dual<N>) -> SVector<f64, N> {
    match &x.eps.0 {
        Some(eps) => *eps,
        None => SVector::<f64, N>::zeros(),
    }
}

/// r and J of any constraint by forward-mode automatic differentiation, in chunks of 4 or 8 partials.
pub fn forward<C: Constraint>(
    constraint: &C,
    at: &mut Point<'_, C::Vars>,
    r: &mut [f64],
    j: &mut Jacobian<'_>,
) {
    let total: usize = C::Vars::tangent_dims(at.x).iter().sum();
    if total <= 4 {
        chunks::<C, 4>(constraint, at, r, j);
    } else {
        chunks::<C, 8>(constraint, at, r, j);
    }
}

fn chunks<C: Constraint, const N: usize>(
    constraint: &C,
    at: &mut Point<'_, C::Vars>,
    r: &mut [f64],
    j: &mut Jacobian<'_>,
) {
    let x = at.x;
    let dims = C::Vars::tangent_dims(x);
    let total: usize = dims.iter().sum();
    let ambient: usize = x.iter().map(|x| x.len()).sum();
    let Buffers::<N> {
        ambient: ambients,
        delta,
        residual,
    } = at.memory();
    ambients.resize(ambient, Dual::from(0.0));
    delta.clear();
    delta.resize(total, Dual::from(0.0));
    residual.clear();
    residual.resize(C::DIM, Dual::from(0.0));

    let mut start = 0;
    loop {
        let end = (start + N).min(total);
        for column in start..end {
            delta[column] = seed(0.0, column - start);
        }
        C::Vars::plus(x, delta, ambients);
        let mut views: [&[Dual<N>]; MAX_VARS] = [&[]; MAX_VARS];
        let mut rest: &[Dual<N>] = ambients;
        for i in 0..C::Vars::COUNT {
            let (head, tail) = rest.split_at(x[i].len());
            views[i] = head;
            rest = tail;
        }
        constraint.residual(C::Vars::views(views), residual);
        if start == 0 {
            for (r, dual) in r.iter_mut().zip(residual.iter()) {
                *r = value(*dual);
            }
        }
        let (mut variable, mut first) = (0, 0);
        for column in start..end {
            while column - first >= dims[variable] {
                first += dims[variable];
                variable += 1;
            }
            let out = j.column_mut(variable, column - first);
            for (o, dual) in out.iter_mut().zip(residual.iter()) {
                *o = dual.eps.0.as_ref().map_or(0.0, |eps| eps[column - start]);
            }
            delta[column] = Dual::from(0.0);
        }
        start = end;
        if start >= total {
            return;
        }
    }
}

/// The value of a vector function and its Jacobian `(OUT × IN)` at `x`, all on the stack: for the
/// small functions a hand-written `linearize` is composed of.
pub fn small<const IN: usize, const OUT: usize>(
    x: &[f64; IN],
    f: impl FnOnce(&[Dual<IN>; IN], &mut [Dual<IN>; OUT]),
) -> ([f64; OUT], nalgebra::SMatrix<f64, OUT, IN>) {
    let duals: [Dual<IN>; IN] = std::array::from_fn(|i| seed(x[i], i));
    let mut out = [Dual::<IN>::from(0.0); OUT];
    f(&duals, &mut out);
    let mut jacobian = nalgebra::SMatrix::<f64, OUT, IN>::zeros();
    for (row, dual) in out.iter().enumerate() {
        jacobian
            .row_mut(row)
            .copy_from(&dual.eps.unwrap_generic(Const::<IN>, Const::<1>).transpose());
    }
    (out.map(value), jacobian)
}

/// r and J of any constraint by central differences in the tangent space, step ε^⅓: slow and good
/// to about ten digits, the reference that shares no code with automatic differentiation.
pub fn central_differences<C: Constraint>(
    constraint: &C,
    at: &mut Point<'_, C::Vars>,
    r: &mut [f64],
    j: &mut Jacobian<'_>,
) {
    #[derive(Default)]
    struct Numbers {
        ambient: Vec<f64>,
        delta: Vec<f64>,
        sides: [Vec<f64>; 2],
    }
    let x = at.x;
    let dims = C::Vars::tangent_dims(x);
    constraint.residual(C::Vars::views(x), r);
    let Numbers {
        ambient,
        delta,
        sides,
    } = at.memory();
    ambient.resize(x.iter().map(|x| x.len()).sum(), 0.0);
    delta.clear();
    delta.resize(dims.iter().sum(), 0.0);
    let h = f64::EPSILON.cbrt();
    let mut first = 0;
    for (variable, dim) in dims.iter().enumerate().take(C::Vars::COUNT) {
        for column in 0..*dim {
            for (side, step) in sides.iter_mut().zip([h, -h]) {
                side.resize(C::DIM, 0.0);
                delta[first + column] = step;
                C::Vars::plus(x, delta, ambient);
                let mut views: [&[f64]; MAX_VARS] = [&[]; MAX_VARS];
                let mut rest: &[f64] = ambient;
                for i in 0..C::Vars::COUNT {
                    (views[i], rest) = rest.split_at(x[i].len());
                }
                constraint.residual(C::Vars::views(views), side);
            }
            delta[first + column] = 0.0;
            for ((o, plus), minus) in j
                .column_mut(variable, column)
                .iter_mut()
                .zip(&sides[0])
                .zip(&sides[1])
            {
                *o = (plus - minus) / (2.0 * h);
            }
        }
        first += dim;
    }
}
