//! Constraints: what supplies residuals.

use crate::autodiff::{self, Scratch};
use crate::scalar::Scalar;
use crate::variable::{MAX_VARS, Vars};

/// The typed views of a constraint's variables.
pub type Views<'a, C, T> = <<C as Constraint>::Vars as Vars>::Views<'a, T>;

/// One measurement that constrains up to five variables: it supplies residual rows r(x).
///
/// Write [`residual`](Self::residual) once, over any [`Scalar`]; the Jacobian comes from automatic
/// differentiation unless [`linearize`](Self::linearize) is overridden by a hand-written one.
/// Residuals are in the measurement's own units: [`Noise`](crate::Noise) and
/// [`Loss`](crate::Loss) are applied by the problem, never by a constraint.
///
/// ```
/// use truing::{Constraint, Problem, Scalar, Views, manifold::Vector};
///
/// /// y = exp(a·t + b), measured at one time.
/// struct Growth { t: f64, y: f64 }
///
/// impl Constraint for Growth {
///     type Vars = (Vector,);
///     const DIM: usize = 1;
///     fn residual<T: Scalar>(&self, (p,): Views<'_, Self, T>, r: &mut [T]) {
///         r[0] = (p[0] * self.t + p[1]).exp() - self.y;
///     }
/// }
///
/// let mut problem = Problem::new();
/// let p = problem.add_variable::<Vector>("p", &vec![0.0, 0.0]);
/// for t in [0.0, 1.0, 2.0] {
///     problem.add("growth", (p,), Growth { t, y: (0.5 * t - 1.0f64).exp() });
/// }
/// let solution = truing::solve(&problem, &Default::default()).unwrap();
/// assert!((solution.values.get(p)[0] - 0.5).abs() < 1e-9);
/// ```
pub trait Constraint: Sized + Send + Sync + 'static {
    /// The variables it is about, e.g. `(Vector, Plane3)`.
    type Vars: Vars;
    /// Number of residual rows.
    const DIM: usize;

    /// Writes the `DIM` residual rows at the given variables, in the measurement's own units.
    fn residual<T: Scalar>(&self, x: Views<'_, Self, T>, r: &mut [T]);

    /// Writes r and J = ∂r/∂δ at δ = 0, δ being the tangents of the variables: automatic
    /// differentiation unless overridden.
    fn linearize(&self, at: &mut Point<'_, Self::Vars>, r: &mut [f64], j: &mut Jacobian<'_>) {
        autodiff::forward(self, at, r, j);
    }
}

/// The point at which a constraint is linearised, with scratch memory that outlives the call.
pub struct Point<'a, V: Vars> {
    pub(crate) x: [&'a [f64]; MAX_VARS],
    pub(crate) scratch: &'a mut Scratch,
    vars: std::marker::PhantomData<fn() -> V>,
}

impl<'a, V: Vars> Point<'a, V> {
    pub(crate) fn new(x: [&'a [f64]; MAX_VARS], scratch: &'a mut Scratch) -> Self {
        Self {
            x,
            scratch,
            vars: std::marker::PhantomData,
        }
    }

    /// The variables as plain numbers.
    pub fn views(&self) -> V::Views<'a, f64> {
        V::views(self.x)
    }

    /// The stored numbers of variable number `i` of the tuple.
    pub fn raw(&self, i: usize) -> &'a [f64] {
        self.x[i]
    }

    /// Memory of the caller's own type that is kept between calls, made by `Default` at first use:
    /// a hand-written Jacobian needs no allocation per constraint.
    pub fn memory<M: Default + Send + 'static>(&mut self) -> &mut M {
        self.scratch.memory()
    }
}

/// The dense Jacobian of one constraint, `DIM` rows by the tangents of its variables.
///
/// Column-major; the columns of variable `i` are one block `(DIM × tangent_dim)`. All entries are
/// zero when `linearize` is called.
pub struct Jacobian<'a> {
    rows: usize,
    offsets: [usize; MAX_VARS + 1],
    data: &'a mut [f64],
}

impl<'a> Jacobian<'a> {
    pub(crate) fn new(rows: usize, dims: [usize; MAX_VARS], data: &'a mut [f64]) -> Self {
        let mut offsets = [0; MAX_VARS + 1];
        for i in 0..MAX_VARS {
            offsets[i + 1] = offsets[i] + dims[i];
        }
        Self {
            rows,
            offsets,
            data,
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The columns of variable `i`, column-major `(rows × tangent_dim)`.
    #[track_caller]
    pub fn block_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.data[self.rows * self.offsets[i]..self.rows * self.offsets[i + 1]]
    }

    /// One column of variable `i`.
    #[track_caller]
    pub fn column_mut(&mut self, i: usize, column: usize) -> &mut [f64] {
        let rows = self.rows;
        &mut self.block_mut(i)[rows * column..rows * (column + 1)]
    }

    /// Sets ∂r\[row\]/∂δ\[column\] of variable `i`.
    #[track_caller]
    pub fn set(&mut self, i: usize, row: usize, column: usize, value: f64) {
        self.column_mut(i, column)[row] = value;
    }
}
