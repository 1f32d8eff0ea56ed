//! Covariance at a solution, independent of damping and scaling.

use crate::error::Error;
use crate::least_squares::{LeastSquares, Linearization};
use crate::step::triangle;
use crate::variable::{Var, Variable};
use nalgebra::DMatrix;

/// The covariance (JᵀJ)⁻¹ of the free columns at a point, from the QR of J.
///
/// Under robust losses this is the covariance of the reweighted linear problem, which is smaller
/// than that of the estimate: evaluate a problem with trivial losses at the robust solution, and
/// scale it by Huber's factor, as `truing-robot` does.
///
/// It is computed from J alone, whitened and reweighted, so no damping, scaling or history of a
/// solver is in it. Multiply by [`sigma0`](Self::sigma0)² where the noise is known up to a factor
/// only.
#[derive(Debug, Clone)]
pub struct Covariance {
    free: Vec<usize>,
    /// (JᵀJ)⁻¹ over the free columns.
    matrix: DMatrix<f64>,
    /// a-posteriori standard deviation of unit weight.
    sigma0: f64,
    degrees_of_freedom: usize,
    condition: f64,
    singular_values: Vec<f64>,
}

impl Covariance {
    /// The covariance at `x`.
    ///
    /// # Errors
    /// If there are more free columns than rows, or a column depends on others.
    pub fn at<P: LeastSquares>(problem: &P, x: &P::Point) -> Result<Self, Error> {
        let mut lin = Linearization::new(problem.structure());
        problem.linearize(x, &mut lin);
        let free = problem.free();
        let n = free.len();
        if lin.structure.rows < n {
            return Err(Error::Underdetermined {
                rows: lin.structure.rows,
                columns: n,
            });
        }
        let scale: Vec<f64> = free
            .iter()
            .map(|c| lin.column_norm(*c))
            .map(|s| if s > 0.0 { s } else { 1.0 })
            .collect();
        let t = triangle(&lin, &free, &scale);
        let r = DMatrix::from_fn(n, n, |i, k| if i <= k { t[(i, k)] } else { 0.0 });
        let threshold = f64::EPSILON * 16.0 * n.max(1) as f64;
        if let Some(k) = (0..n).find(|k| r[(*k, *k)].abs() <= threshold) {
            return Err(Error::RankDeficient {
                column: problem.describe_column(free[k]),
                pivot: r[(k, k)].abs(),
                threshold,
            });
        }
        let mut singular_values: Vec<f64> = match n {
            // Nothing free is known exactly; an empty matrix has no decomposition.
            0 => Vec::new(),
            _ => r.clone().singular_values().iter().copied().collect(),
        };
        singular_values.sort_by(|a, b| b.total_cmp(a));
        let condition = match (singular_values.first(), singular_values.last()) {
            (Some(first), Some(last)) => first / last,
            _ => 1.0,
        };
        let inverse =
            r.solve_upper_triangular(&DMatrix::identity(n, n))
                .ok_or(Error::RankDeficient {
                    column: "a column".into(),
                    pivot: 0.0,
                    threshold,
                })?;
        let mut matrix = &inverse * inverse.transpose();
        for i in 0..n {
            for k in 0..n {
                matrix[(i, k)] /= scale[i] * scale[k];
            }
        }
        let degrees_of_freedom = lin.structure.rows - n;
        let squares: f64 = lin.residual.iter().map(|r| r * r).sum();
        let sigma0 = if degrees_of_freedom > 0 {
            (squares / degrees_of_freedom as f64).sqrt()
        } else {
            f64::NAN
        };
        Ok(Self {
            free,
            matrix,
            sigma0,
            degrees_of_freedom,
            condition,
            singular_values,
        })
    }

    /// a-posteriori standard deviation of unit weight √(‖r‖² / (rows − free)); near one when the
    /// noise models are right, NaN without redundancy.
    pub fn sigma0(&self) -> f64 {
        self.sigma0
    }

    /// Rows minus free columns.
    pub fn degrees_of_freedom(&self) -> usize {
        self.degrees_of_freedom
    }

    /// Condition number of J with columns scaled to unit length.
    pub fn condition(&self) -> f64 {
        self.condition
    }

    /// Singular values of J with columns scaled to unit length, descending.
    pub fn singular_values(&self) -> &[f64] {
        &self.singular_values
    }

    /// Covariance of two columns; zero where one of them is fixed.
    pub fn entry(&self, a: usize, b: usize) -> f64 {
        match (self.free.binary_search(&a), self.free.binary_search(&b)) {
            (Ok(a), Ok(b)) => self.matrix[(a, b)],
            _ => 0.0,
        }
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
}
