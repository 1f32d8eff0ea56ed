//! Covariance at a solution, independent of damping and scaling.

use crate::error::Error;
use crate::least_squares::{LeastSquares, Linearization, StepBounds};
use crate::step::{null_space, triangle};
use crate::variable::{Var, Variable};
use faer::Mat;
use nalgebra::DMatrix;

/// The covariance Σ = (JᵀJ)⁻¹ of the free columns at a point, from the QR of J.
///
/// Under robust losses this is the covariance of the reweighted linear problem, which is smaller
/// than that of the estimate: see [`robust`](Self::robust).
///
/// It is computed from J alone, whitened and reweighted, so no damping, scaling or history of a
/// solver is in it. Multiply by [`sigma0`](Self::sigma0)² where the noise is known up to a factor
/// only. Columns that are fixed are known exactly: what holding them leaves out (where the whole
/// estimate stands, say) is in no variance.
///
/// Time is n³ and memory n² for n free columns, whatever J looks like: a few thousand are the limit.
/// The number of rows costs time only.
#[derive(Debug, Clone)]
pub struct Covariance {
    free: Vec<usize>,
    /// S (k × n) over the free columns with Σ = SᵀS, where JSᵀ has orthonormal columns: k = n, or the
    /// dimension of the subspace that the estimate is confined to.
    root: DMatrix<f64>,
    /// ‖r‖², whitened and reweighted.
    squares: f64,
    sigma0: f64,
    rows: usize,
    condition: f64,
    singular_values: Vec<f64>,
    robust: bool,
}

impl Covariance {
    /// The covariance at `x`: of what is free and not at a limit.
    ///
    /// A limit that is active at `x` counts as an equality, so that Σ is that of the subspace that is
    /// left, and a column at a bound has variance zero. That is the covariance of the estimate *given*
    /// that these limits are active.
    ///
    /// # Errors
    /// If there are more free columns than rows, or a column depends on others.
    pub fn at<P: LeastSquares>(problem: &P, x: &P::Point) -> Result<Self, Error> {
        let mut lin = Linearization::new(problem.structure());
        problem.linearize(x, &mut lin);
        let basis = problem
            .step_bounds(x)
            .and_then(|bounds| inside(&lin, &problem.free(), &bounds));
        Self::of(problem, x, lin, basis.as_ref())
    }

    /// The covariance of an estimate that can only move by δ = N y: Σ = N (NᵀJᵀJN)⁻¹ Nᵀ.
    ///
    /// `basis` is N (free columns × k): one row for every free column in ascending order, and
    /// independent columns, which need not be orthogonal. Equality constraints C δ = 0 have the null
    /// space of C as N; a limit that is active is such a constraint. Without a basis N is the
    /// identity. Degrees of freedom are rows − k.
    ///
    /// # Errors
    /// If k is more than the rows, or J N has dependent columns.
    ///
    /// # Panics
    /// If the basis does not have a row for every free column.
    #[track_caller]
    pub fn within<P: LeastSquares>(
        problem: &P,
        x: &P::Point,
        basis: Option<&DMatrix<f64>>,
    ) -> Result<Self, Error> {
        let mut lin = Linearization::new(problem.structure());
        problem.linearize(x, &mut lin);
        Self::of(problem, x, lin, basis)
    }

    #[track_caller]
    fn of<P: LeastSquares>(
        problem: &P,
        x: &P::Point,
        mut lin: Linearization,
        basis: Option<&DMatrix<f64>>,
    ) -> Result<Self, Error> {
        let free = problem.free();
        let n = free.len();
        let k = basis.map_or(n, DMatrix::ncols);
        if let Some(basis) = basis {
            assert_eq!(
                basis.nrows(),
                n,
                "the basis has {} rows for {n} free columns",
                basis.nrows()
            );
        }
        if lin.structure.rows < k {
            return Err(Error::Underdetermined {
                rows: lin.structure.rows,
                columns: k,
            });
        }
        let scale: Vec<f64> = free
            .iter()
            .map(|c| lin.column_norm(*c))
            .map(|s| if s > 0.0 { s } else { 1.0 })
            .collect();
        let t = triangle(&lin, &free, &scale);
        let r = DMatrix::from_fn(n, n, |i, j| if i <= j { t[(i, j)] } else { 0.0 });
        let name = |i: usize| match basis {
            None => problem.describe_column(free[i]),
            // The column that the direction moves most.
            Some(basis) => {
                let moved = |k: &usize| (basis[(*k, i)] * scale[*k]).abs();
                let most = (0..n).max_by(|a, b| moved(a).total_cmp(&moved(b)));
                most.map_or_else(String::new, |k| problem.describe_column(free[k]))
            }
        };
        // J D⁻¹ = Q R; within a subspace J N E⁻¹ = Q (R D N E⁻¹), of which only the triangle counts,
        // E being the lengths of its columns.
        let (r, lengths) = match basis {
            None => (r, vec![1.0; n]),
            Some(basis) => {
                let mut image = &r * DMatrix::from_fn(n, k, |i, j| scale[i] * basis[(i, j)]);
                let lengths: Vec<f64> = image
                    .column_iter()
                    .map(|column| column.norm())
                    .map(|s| if s > 0.0 { s } else { 1.0 })
                    .collect();
                for (mut column, length) in image.column_iter_mut().zip(&lengths) {
                    column.unscale_mut(*length);
                }
                (image.qr().unpack_r(), lengths)
            }
        };
        let threshold = f64::EPSILON * 16.0 * k.max(1) as f64;
        let pivot = |i: usize| r.get((i, i)).map_or(0.0, |pivot| pivot.abs());
        if let Some(i) = (0..k).find(|i| pivot(*i) <= threshold) {
            return Err(Error::RankDeficient {
                column: name(i),
                pivot: pivot(i),
                threshold,
            });
        }
        let mut singular_values: Vec<f64> = match k {
            // Nothing free is known exactly; an empty matrix has no decomposition.
            0 => Vec::new(),
            _ => r.clone().singular_values().iter().copied().collect(),
        };
        singular_values.sort_by(|a, b| b.total_cmp(a));
        let condition = match (singular_values.first(), singular_values.last()) {
            (Some(first), Some(last)) => first / last,
            _ => 1.0,
        };
        let mut inverse =
            r.solve_upper_triangular(&DMatrix::identity(k, k))
                .ok_or(Error::RankDeficient {
                    column: "a column".into(),
                    pivot: 0.0,
                    threshold,
                })?;
        for (mut row, length) in inverse.row_iter_mut().zip(&lengths) {
            row.unscale_mut(*length);
        }
        let root = match basis {
            None => {
                for (mut row, scale) in inverse.row_iter_mut().zip(&scale) {
                    row.unscale_mut(*scale);
                }
                inverse.transpose()
            }
            Some(basis) => (basis * inverse).transpose(),
        };
        // Under a robust loss the residual of the linearisation is longer than the weighted one.
        problem.residual(x, &mut lin.residual);
        let squares: f64 = lin.residual.iter().map(|r| r * r).sum();
        let rows = lin.structure.rows;
        let sigma0 = match rows - k {
            0 => f64::NAN,
            freedom => (squares / freedom as f64).sqrt(),
        };
        Ok(Self {
            free,
            root,
            squares,
            sigma0,
            rows,
            condition,
            singular_values,
            robust: problem.is_robust(),
        })
    }

    /// The same with another standard deviation of unit weight.
    pub(super) fn with_sigma0(self, sigma0: f64) -> Self {
        Self {
            sigma0,
            robust: true,
            ..self
        }
    }

    /// a-posteriori standard deviation of unit weight √(‖r‖² / (rows − free)); near one when the
    /// noise models are right, NaN without redundancy. Of [`robust`](Self::robust), Huber's factor.
    pub fn sigma0(&self) -> f64 {
        self.sigma0
    }

    /// Rows minus what is free: columns, or the dimension of the subspace.
    pub fn degrees_of_freedom(&self) -> usize {
        self.rows - self.rank()
    }

    /// The number of independent unknowns: free columns, or the dimension of the subspace. All
    /// leverages add up to it.
    pub fn rank(&self) -> usize {
        self.root.nrows()
    }

    /// Condition number of J with columns scaled to unit length.
    pub fn condition(&self) -> f64 {
        self.condition
    }

    /// Singular values of J with columns scaled to unit length, descending.
    pub fn singular_values(&self) -> &[f64] {
        &self.singular_values
    }

    /// Columns that are free, ascending.
    pub fn free(&self) -> &[usize] {
        &self.free
    }

    /// Covariance of two columns; zero where one of them is fixed.
    pub fn entry(&self, a: usize, b: usize) -> f64 {
        match (self.position(a), self.position(b)) {
            (Some(a), Some(b)) => self.root.column(a).dot(&self.root.column(b)),
            _ => 0.0,
        }
    }

    /// Covariance of all free columns (free × free), in their order.
    pub fn matrix(&self) -> DMatrix<f64> {
        self.root.tr_mul(&self.root)
    }

    /// Standard deviation of a column; zero where it is fixed.
    pub fn std_dev(&self, column: usize) -> f64 {
        self.entry(column, column).sqrt()
    }

    /// Standard deviations of a variable's components.
    pub fn std_devs<V: Variable>(&self, var: Var<V>) -> Vec<f64> {
        (0..var.tangent_dim())
            .map(|k| self.std_dev(var.column() + k))
            .collect()
    }

    /// Covariance between two variables (tangent of a × tangent of b).
    pub fn block<A: Variable, B: Variable>(&self, a: Var<A>, b: Var<B>) -> DMatrix<f64> {
        DMatrix::from_fn(a.tangent_dim(), b.tangent_dim(), |i, k| {
            self.entry(a.column() + i, b.column() + k)
        })
    }

    /// S over the free columns, with Σ = SᵀS.
    pub(super) fn root(&self) -> &DMatrix<f64> {
        &self.root
    }

    /// ‖r‖² where it was made.
    pub(super) fn squares(&self) -> f64 {
        self.squares
    }

    /// Whether a robust loss has a part in it.
    pub(super) fn is_robust(&self) -> bool {
        self.robust
    }

    /// Where a column is among the free ones.
    pub(super) fn position(&self, column: usize) -> Option<usize> {
        self.free.binary_search(&column).ok()
    }
}

/// A basis of the steps that leave the limits active at the point as they are (free × k); `None` if
/// none is.
fn inside(lin: &Linearization, free: &[usize], bounds: &StepBounds) -> Option<DMatrix<f64>> {
    let at = |lower: f64, upper: f64| lower >= 0.0 || upper <= 0.0;
    let moving: Vec<usize> = (0..free.len())
        .filter(|k| !at(bounds.lower[free[*k]], bounds.upper[free[*k]]))
        .collect();
    let mut place = vec![None; lin.structure.cols()];
    for (i, k) in moving.iter().enumerate() {
        place[free[*k]] = Some(i);
    }
    // Scaled by the lengths of the columns, so that units do not decide what depends on what.
    let length: Vec<f64> = moving
        .iter()
        .map(|k| lin.column_norm(free[*k]))
        .map(|length| if length > 0.0 { length } else { 1.0 })
        .collect();
    let rows: Vec<Vec<(usize, f64)>> = (bounds.rows.iter())
        .filter(|row| at(row.lower, row.upper) || row.lower == row.upper)
        .map(|row| {
            let terms = row.terms.iter();
            terms
                .filter_map(|(column, a)| place[*column].map(|i| (i, a / length[i])))
                .collect()
        })
        .filter(|terms: &Vec<(usize, f64)>| !terms.is_empty())
        .collect();
    if moving.len() == free.len() && rows.is_empty() {
        return None;
    }
    let n = moving.len();
    let basis = if rows.is_empty() {
        DMatrix::identity(n, n)
    } else {
        let mut matrix = Mat::<f64>::zeros(rows.len(), n);
        for (row, terms) in rows.iter().enumerate() {
            let norm = terms.iter().map(|(_, a)| a * a).sum::<f64>().sqrt();
            for (i, a) in terms {
                matrix[(row, *i)] += if norm > 0.0 { a / norm } else { 0.0 };
            }
        }
        let left = null_space(&matrix, &vec![0.0; rows.len()]).basis;
        DMatrix::from_fn(n, left.ncols(), |i, k| left[(i, k)])
    };
    let mut all = DMatrix::zeros(free.len(), basis.ncols());
    for (i, k) in moving.iter().enumerate() {
        for (j, entry) in basis.row(i).iter().enumerate() {
            all[(*k, j)] = entry / length[i];
        }
    }
    Some(all)
}
