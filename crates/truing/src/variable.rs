//! Unknowns: what kind they are, typed handles to them, and all their numbers.

use crate::autodiff::{partials, seed};
use crate::scalar::{Dual, Scalar};
use serde::{Deserialize, Serialize};
use std::any::TypeId;
use std::marker::PhantomData;
use std::ops::Range;

/// A kind of unknown: a manifold stored flat.
///
/// Laws (tested by [`crate::check::variable`]): x ⊞ 0 = x; (x ⊞ δ) ⊟ x = δ for small δ, and the
/// derivative of that at δ = 0 is the identity; x ⊞ (y ⊟ x) = y.
pub trait Variable: Send + Sync + 'static {
    /// Whether ⊞ is plain addition on the stored numbers, one degree of freedom each.
    const FLAT: bool = false;

    /// The value as a user gives and gets it.
    type Value: Clone + std::fmt::Debug;
    /// What a constraint sees: `Pose<T>`, `&[T]`, ….
    type View<'a, T: Scalar>;

    /// Reads the stored numbers as what a constraint sees.
    fn view<T: Scalar>(x: &[T]) -> Self::View<'_, T>;
    /// Retraction: out = x ⊞ δ, exact to first order in δ.
    fn plus<T: Scalar>(x: &[f64], delta: &[T], out: &mut [T]);
    /// Inverse retraction: out = x ⊟ origin, the δ with origin ⊞ δ = x.
    fn minus<T: Scalar>(x: &[T], origin: &[f64], out: &mut [T]);
    /// Degrees of freedom of a variable stored in `ambient_dim` numbers.
    fn tangent_dim(ambient_dim: usize) -> usize;
    /// The numbers that store a value.
    fn store(value: &Self::Value) -> Vec<f64>;
    /// The value that the numbers store.
    fn load(x: &[f64]) -> Self::Value;
}

/// A typed handle to one variable of a [`Problem`](crate::Problem): a constraint on a plane cannot
/// be given a pose by mistake.
pub struct Var<V: Variable> {
    pub(crate) slot: Slot,
    kind: PhantomData<fn() -> V>,
}

/// Where a variable is: its number, its stored numbers and its columns.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Slot {
    /// Number of the variable in its problem.
    pub index: usize,
    /// First stored number in [`Values`].
    pub offset: usize,
    /// How many numbers store it.
    pub len: usize,
    /// First column of the Jacobian.
    pub column: usize,
}

impl<V: Variable> Var<V> {
    pub(crate) fn new(slot: Slot) -> Self {
        Self {
            slot,
            kind: PhantomData,
        }
    }

    /// Number of the variable in its problem, from 0 in order of creation.
    pub fn index(self) -> usize {
        self.slot.index
    }

    /// First of its columns in the Jacobian.
    pub fn column(self) -> usize {
        self.slot.column
    }

    /// Degrees of freedom.
    pub fn tangent_dim(self) -> usize {
        V::tangent_dim(self.slot.len)
    }
}

impl<V: Variable> Clone for Var<V> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<V: Variable> Copy for Var<V> {}

impl<V: Variable> std::fmt::Debug for Var<V> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Var({})", self.slot.index)
    }
}

/// A handle whose type is known at run time only: what holds unknowns of many types keeps these.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AnyVar {
    slot: Slot,
    kind: TypeId,
    tangent_dim: usize,
}

impl AnyVar {
    /// The typed handle, if it is of that type.
    pub fn typed<V: Variable>(self) -> Option<Var<V>> {
        (self.kind == TypeId::of::<V>()).then(|| Var::new(self.slot))
    }

    /// Number of the variable in its problem, from 0 in order of creation.
    pub fn index(self) -> usize {
        self.slot.index
    }

    /// Its columns in the Jacobian.
    pub fn columns(self) -> Range<usize> {
        self.slot.column..self.slot.column + self.tangent_dim
    }
}

impl<V: Variable> From<Var<V>> for AnyVar {
    fn from(var: Var<V>) -> Self {
        Self {
            slot: var.slot,
            kind: TypeId::of::<V>(),
            tangent_dim: var.tangent_dim(),
        }
    }
}

/// All the numbers of a problem's variables, stored flat. Cheap to clone, serialisable.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Values {
    pub(crate) data: Vec<f64>,
}

impl Values {
    /// The value of a variable.
    #[track_caller]
    pub fn get<V: Variable>(&self, var: Var<V>) -> V::Value {
        V::load(self.raw(var))
    }

    /// Gives a variable another value.
    ///
    /// # Panics
    /// If the value is of another length than the variable.
    #[track_caller]
    pub fn set<V: Variable>(&mut self, var: Var<V>, value: &V::Value) {
        let stored = V::store(value);
        let slot = var.slot;
        assert_eq!(
            stored.len(),
            slot.len,
            "variable {} has {} numbers, the value has {}",
            slot.index,
            slot.len,
            stored.len()
        );
        self.data[slot.offset..slot.offset + slot.len].copy_from_slice(&stored);
    }

    /// The stored numbers of a variable.
    #[track_caller]
    pub fn raw<V: Variable>(&self, var: Var<V>) -> &[f64] {
        &self.data[var.slot.offset..var.slot.offset + var.slot.len]
    }

    /// The stored numbers of a variable of any type.
    #[track_caller]
    pub fn raw_any(&self, var: AnyVar) -> &[f64] {
        &self.data[var.slot.offset..var.slot.offset + var.slot.len]
    }

    /// All numbers, variable after variable.
    pub fn as_slice(&self) -> &[f64] {
        &self.data
    }
}

/// A variable as the problem keeps it, its type erased to what the loop needs.
#[derive(Clone)]
pub(crate) struct VariableSlot {
    pub name: String,
    pub ambient: Range<usize>,
    pub tangent: Range<usize>,
    /// Names of its components; none to number them.
    pub components: Vec<String>,
    pub plus: fn(&[f64], &[f64], &mut [f64]),
    pub minus: fn(&[f64], &[f64], &mut [f64]),
    /// ∂((x ⊞ δ) ⊟ reference)/∂δ at δ = 0 (n × n, row after row).
    pub slope: fn(&[f64], &[f64], &mut [f64]),
    /// Whether ⊞ is addition.
    pub flat: bool,
}

/// ∂((x ⊞ δ) ⊟ reference)/∂δ at δ = 0 (n × n, row after row), by automatic differentiation.
pub(crate) fn slope<V: Variable>(x: &[f64], reference: &[f64], out: &mut [f64]) {
    let n = V::tangent_dim(x.len());
    let mut moved = vec![Dual::<1>::from(0.0); x.len()];
    let mut back = vec![Dual::<1>::from(0.0); n];
    for k in 0..n {
        let mut delta = vec![Dual::<1>::from(0.0); n];
        delta[k] = seed(0.0, 0);
        V::plus(x, &delta, &mut moved);
        V::minus(&moved, reference, &mut back);
        for (i, back) in back.iter().enumerate() {
            out[i * n + k] = partials(back)[0];
        }
    }
}

/// Most variables one constraint can have.
pub const MAX_VARS: usize = 5;

/// A tuple of one to five variables, e.g. `(Vector, Plane3)`.
///
/// Implemented for tuples; not meant to be implemented elsewhere.
pub trait Vars: 'static {
    /// Number of variables.
    const COUNT: usize;
    /// What a constraint sees of them, e.g. `(&[T], Plane<T>)`.
    type Views<'a, T: Scalar>;
    /// The handles, e.g. `(Var<Vector>, Var<Plane3>)`.
    type Handles: Copy + Send + Sync;

    /// The typed views of the stored numbers.
    fn views<'a, T: Scalar>(x: [&'a [T]; MAX_VARS]) -> Self::Views<'a, T>;
    /// Every variable's retraction: `delta` holds the tangents one after another, `out` the ambient numbers.
    fn plus<T: Scalar>(x: [&[f64]; MAX_VARS], delta: &[T], out: &mut [T]);
    /// Tangent dimensions.
    fn tangent_dims(x: [&[f64]; MAX_VARS]) -> [usize; MAX_VARS];
    /// Where the variables are.
    fn slots(handles: Self::Handles) -> [Slot; MAX_VARS];
}

macro_rules! impl_vars {
    ($count:literal; $($V:ident $i:tt),+) => {
        impl<$($V: Variable),+> Vars for ($($V,)+) {
            const COUNT: usize = $count;
            type Views<'a, T: Scalar> = ($($V::View<'a, T>,)+);
            type Handles = ($(Var<$V>,)+);

            #[inline]
            fn views<'a, T: Scalar>(x: [&'a [T]; MAX_VARS]) -> Self::Views<'a, T> {
                ($($V::view(x[$i]),)+)
            }

            #[inline]
            fn plus<T: Scalar>(x: [&[f64]; MAX_VARS], mut delta: &[T], mut out: &mut [T]) {
                $(
                    let (d, rest) = delta.split_at($V::tangent_dim(x[$i].len()));
                    let (o, others) = out.split_at_mut(x[$i].len());
                    $V::plus(x[$i], d, o);
                    delta = rest;
                    out = others;
                )+
                let _ = (delta, out);
            }

            fn tangent_dims(x: [&[f64]; MAX_VARS]) -> [usize; MAX_VARS] {
                let mut dims = [0; MAX_VARS];
                $(dims[$i] = $V::tangent_dim(x[$i].len());)+
                dims
            }

            fn slots(handles: Self::Handles) -> [Slot; MAX_VARS] {
                let mut slots = [Slot::default(); MAX_VARS];
                $(slots[$i] = handles.$i.slot;)+
                slots
            }
        }
    };
}

impl_vars!(1; A 0);
impl_vars!(2; A 0, B 1);
impl_vars!(3; A 0, B 1, C 2);
impl_vars!(4; A 0, B 1, C 2, D 3);
impl_vars!(5; A 0, B 1, C 2, D 3, E 4);
