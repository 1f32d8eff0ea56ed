//! What a solver needs of a problem.

use crate::error::Error;
use std::sync::Arc;

/// Where the entries of a Jacobian are: compressed columns, rows ascending in each.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// Number of rows.
    pub rows: usize,
    /// Start of every column in `row_indices`, and the total: `cols + 1` numbers.
    pub column_starts: Vec<usize>,
    /// Row of every entry.
    pub row_indices: Vec<usize>,
}

impl Structure {
    /// Every entry present.
    pub fn dense(rows: usize, cols: usize) -> Self {
        Self {
            rows,
            column_starts: (0..=cols).map(|c| c * rows).collect(),
            row_indices: (0..cols).flat_map(|_| 0..rows).collect(),
        }
    }

    /// Number of columns.
    pub fn cols(&self) -> usize {
        self.column_starts.len() - 1
    }
}

/// r and J together at one point, with the cost ½Σρ.
#[derive(Debug, Clone)]
pub struct Linearization {
    /// Where the entries of J are.
    pub structure: Arc<Structure>,
    /// The entries of J (rows × cols), in the order of the structure.
    pub values: Vec<f64>,
    /// r, whitened and weighted so that Jᵀr is the gradient of the cost. Under robust losses it is the
    /// r̃ of [`Loss`](crate::Loss), up to √10 longer than what [`LeastSquares::residual`] gives.
    pub residual: Vec<f64>,
    /// ½Σρ(‖r‖²) over the measurements.
    pub cost: f64,
}

impl Linearization {
    /// Memory for a problem of this structure.
    pub fn new(structure: Arc<Structure>) -> Self {
        Self {
            values: vec![0.0; structure.row_indices.len()],
            residual: vec![0.0; structure.rows],
            cost: f64::NAN,
            structure,
        }
    }

    /// The entries of a column with their rows.
    pub fn column(&self, column: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.structure.column_starts[column]..self.structure.column_starts[column + 1];
        self.structure.row_indices[range.clone()]
            .iter()
            .copied()
            .zip(self.values[range].iter().copied())
    }

    /// Gradient of the cost with respect to a column: Jᵢᵀ r.
    pub fn gradient(&self, column: usize) -> f64 {
        self.column(column)
            .map(|(row, j)| j * self.residual[row])
            .sum()
    }

    /// Euclidean length of a column.
    pub fn column_norm(&self, column: usize) -> f64 {
        let largest = self
            .column(column)
            .fold(0.0_f64, |m, (_, j)| m.max(j.abs()));
        if largest == 0.0 || !largest.is_finite() {
            return largest;
        }
        largest
            * self
                .column(column)
                .map(|(_, j)| (j / largest) * (j / largest))
                .sum::<f64>()
                .sqrt()
    }
}

/// Limits on a step: lower ≤ δ ≤ upper, infinite where there is none, one number a column; and
/// lower ≤ Aδ ≤ upper, row by row.
///
/// A limit is active at the point where one of its sides is zero.
#[derive(Debug, Clone, PartialEq)]
pub struct StepBounds {
    /// Lower bounds, at most zero.
    pub lower: Vec<f64>,
    /// Upper bounds, at least zero.
    pub upper: Vec<f64>,
    /// Linear limits.
    pub rows: Vec<LinearBound>,
}

impl StepBounds {
    /// No limits on `columns` columns.
    pub fn unlimited(columns: usize) -> Self {
        Self {
            lower: vec![f64::NEG_INFINITY; columns],
            upper: vec![f64::INFINITY; columns],
            rows: Vec::new(),
        }
    }

    /// Whether δ keeps every limit, rows up to rounding.
    pub fn hold(&self, delta: &[f64]) -> bool {
        let within = |d: &f64, (l, u): (&f64, &f64)| l <= d && d <= u;
        let columns = delta.iter().zip(self.lower.iter().zip(&self.upper));
        let rows = self.rows.iter().all(|row| {
            let terms = row.terms.iter().map(|(column, a)| a * delta[*column]);
            let size = terms.clone().map(f64::abs).sum::<f64>();
            let rounding = row.rounding + 16.0 * f64::EPSILON * size;
            let value: f64 = terms.sum();
            row.lower - rounding <= value && value <= row.upper + rounding
        });
        rows && columns.into_iter().all(|(d, limits)| within(d, limits))
    }
}

/// lower ≤ Σ aₖ δₖ ≤ upper; an equality where both are the same.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearBound {
    /// The pairs (column, aₖ).
    pub terms: Vec<(usize, f64)>,
    /// Lower limit, at most zero unless it is an equality.
    pub lower: f64,
    /// Upper limit, at least zero unless it is an equality.
    pub upper: f64,
    /// What rounding at the point may do to the sum: violations up to it count as none.
    pub rounding: f64,
}

/// min ½‖r(x)‖² under bounds and linear limits. [`Problem`](crate::Problem) is one; a plain test
/// function can be another.
pub trait LeastSquares {
    /// A point: all unknowns.
    type Point: Clone;

    /// Where the entries of J are; the same object as long as the problem does not change.
    fn structure(&self) -> Arc<Structure>;
    /// r at x, whitened and reweighted, and the cost.
    fn residual(&self, x: &Self::Point, r: &mut [f64]) -> f64;
    /// r, J and the cost at x. J is complete: fixed columns too.
    fn linearize(&self, x: &Self::Point, lin: &mut Linearization);
    /// x ⊞ δ, one number a column.
    fn plus(&self, x: &Self::Point, delta: &[f64]) -> Self::Point;
    /// A measure of the size of x, to which the size of a step is compared.
    fn norm(&self, x: &Self::Point) -> f64;
    /// The size of what each column moves, to whose last bits the residual is compared: a number
    /// for every column, [`norm`](Self::norm) by default.
    fn sizes(&self, x: &Self::Point) -> Vec<f64> {
        vec![self.norm(x); self.structure().cols()]
    }
    /// Columns that are estimated, ascending. All by default.
    fn free(&self) -> Vec<usize> {
        (0..self.structure().cols()).collect()
    }
    /// Limits on a step from x, which keeps them; `None` where there are none.
    fn step_bounds(&self, _x: &Self::Point) -> Option<StepBounds> {
        None
    }
    /// Whether residuals are weighted by a robust loss: their second derivatives along a step are
    /// then not those of the weighted linear model.
    fn is_robust(&self) -> bool {
        false
    }
    /// A row in words, for errors.
    fn describe_row(&self, row: usize) -> String {
        format!("row {row}")
    }
    /// A column in words, for errors.
    fn describe_column(&self, column: usize) -> String {
        format!("column {column}")
    }
    /// A linear limit in words, by its number in [`StepBounds::rows`].
    fn describe_limit(&self, row: usize) -> String {
        format!("linear limit {row}")
    }
    /// The point nearest to `x` that keeps all limits: where a solver starts. `x` itself by default.
    ///
    /// # Errors
    /// If there is none.
    fn feasible(&self, x: &Self::Point) -> Result<Self::Point, Error> {
        Ok(x.clone())
    }
}

impl<P: LeastSquares + ?Sized> LeastSquares for &P {
    type Point = P::Point;

    fn structure(&self) -> Arc<Structure> {
        (**self).structure()
    }
    fn residual(&self, x: &Self::Point, r: &mut [f64]) -> f64 {
        (**self).residual(x, r)
    }
    fn linearize(&self, x: &Self::Point, lin: &mut Linearization) {
        (**self).linearize(x, lin);
    }
    fn plus(&self, x: &Self::Point, delta: &[f64]) -> Self::Point {
        (**self).plus(x, delta)
    }
    fn norm(&self, x: &Self::Point) -> f64 {
        (**self).norm(x)
    }
    fn sizes(&self, x: &Self::Point) -> Vec<f64> {
        (**self).sizes(x)
    }
    fn free(&self) -> Vec<usize> {
        (**self).free()
    }
    fn step_bounds(&self, x: &Self::Point) -> Option<StepBounds> {
        (**self).step_bounds(x)
    }
    fn is_robust(&self) -> bool {
        (**self).is_robust()
    }
    fn describe_row(&self, row: usize) -> String {
        (**self).describe_row(row)
    }
    fn describe_column(&self, column: usize) -> String {
        (**self).describe_column(column)
    }
    fn describe_limit(&self, row: usize) -> String {
        (**self).describe_limit(row)
    }
    fn feasible(&self, x: &Self::Point) -> Result<Self::Point, Error> {
        (**self).feasible(x)
    }
}

/// Checks that a linearisation at the start is finite, and says in words what is not.
///
/// # Errors
/// Names the first row or derivative that is NaN or infinite.
pub fn check_finite<P: LeastSquares>(
    problem: &P,
    lin: &Linearization,
    free: &[usize],
) -> Result<(), Error> {
    if let Some(row) = lin.residual.iter().position(|r| !r.is_finite()) {
        return Err(Error::NotFinite {
            row: problem.describe_row(row),
            value: lin.residual[row],
        });
    }
    if !lin.cost.is_finite() {
        let largest = |a: &usize, b: &usize| {
            let [a, b] = [a, b].map(|row| lin.residual[*row].abs());
            a.total_cmp(&b)
        };
        let row = (0..lin.residual.len()).max_by(largest).unwrap_or(0);
        return Err(Error::NotFinite {
            row: format!("{} squared", problem.describe_row(row)),
            value: lin.cost,
        });
    }
    for &column in free {
        if let Some((row, value)) = lin.column(column).find(|(_, j)| !j.is_finite()) {
            return Err(Error::DerivativeNotFinite {
                row: problem.describe_row(row),
                column: problem.describe_column(column),
                value,
            });
        }
    }
    Ok(())
}
