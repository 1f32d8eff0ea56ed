//! argmin's own problem traits on [`Problem`], so that argmin's other solvers run on it.

use crate::error::Error;
use crate::least_squares::{LeastSquares, Linearization};
use crate::problem::Problem;
use crate::variable::Values;
use argmin::core::{CostFunction, Gradient, Jacobian, Operator};

/// ½Σρ at x₀ ⊞ p; infinite where the model has no value, so that line searches turn back.
///
/// The parameter p of all four traits is the tangent at the problem's starting values x₀, one number
/// for each free column: all zeros is the start ([`Problem::at`] gives the values). Bounds and
/// linear limits are unknown to argmin's solvers and are not kept.
impl CostFunction for Problem {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, p: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let mut r = vec![0.0; self.rows()];
        let cost = self.residual(&self.at(p)?, &mut r);
        Ok(if cost.is_nan() { f64::INFINITY } else { cost })
    }
}

/// r at x₀ ⊞ p, whitened; under robust losses the r̃ that goes with the Jacobian: Jᵀr̃ is the gradient.
impl Operator for Problem {
    type Param = Vec<f64>;
    type Output = Vec<f64>;

    fn apply(&self, p: &Vec<f64>) -> Result<Vec<f64>, argmin::core::Error> {
        let x = self.at(p)?;
        if LeastSquares::is_robust(self) {
            let mut lin = Linearization::new(self.structure());
            self.linearize(&x, &mut lin);
            return Ok(lin.residual);
        }
        let mut r = vec![0.0; self.rows()];
        self.residual(&x, &mut r);
        Ok(r)
    }
}

/// ∂cost/∂p = (∂r/∂p)ᵀ r.
impl Gradient for Problem {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, p: &Vec<f64>) -> Result<Vec<f64>, argmin::core::Error> {
        let x = self.at(p)?;
        let mut lin = Linearization::new(self.structure());
        self.linearize(&x, &mut lin);
        let along: Vec<f64> = (0..self.cols())
            .map(|column| lin.gradient(column))
            .collect();
        let mut all = vec![0.0; self.cols()];
        for (range, slope) in self.chart_slopes(&x)? {
            for (k, column) in range.clone().enumerate() {
                all[column] = match &slope {
                    None => along[column],
                    Some(slope) => (range.clone().enumerate())
                        .map(|(i, column)| along[column] * slope[(i, k)])
                        .sum(),
                };
            }
        }
        Ok(self.free().iter().map(|column| all[*column]).collect())
    }
}

/// ∂r/∂p, row after row.
impl Jacobian for Problem {
    type Param = Vec<f64>;
    type Jacobian = Vec<Vec<f64>>;

    fn jacobian(&self, p: &Vec<f64>) -> Result<Vec<Vec<f64>>, argmin::core::Error> {
        let x = self.at(p)?;
        let mut lin = Linearization::new(self.structure());
        self.linearize(&x, &mut lin);
        let free = self.free();
        let mut place = vec![None; self.cols()];
        for (k, column) in free.iter().enumerate() {
            place[*column] = Some(k);
        }
        let mut rows = vec![vec![0.0; free.len()]; self.rows()];
        for (range, slope) in self.chart_slopes(&x)? {
            for (i, column) in range.clone().enumerate() {
                for (k, target) in range.clone().enumerate() {
                    let factor = match &slope {
                        None => f64::from(u8::from(i == k)),
                        Some(slope) => slope[(i, k)],
                    };
                    if let (Some(target), true) = (place[target], factor != 0.0) {
                        for (row, j) in lin.column(column) {
                            rows[row][target] += j * factor;
                        }
                    }
                }
            }
        }
        Ok(rows)
    }
}

impl Problem {
    /// The values x₀ ⊞ p, with x₀ the starting values and one number of p for each free column.
    ///
    /// # Errors
    /// If p has another length.
    pub fn at(&self, p: &[f64]) -> Result<Values, Error> {
        let free = self.free();
        if p.len() != free.len() {
            return Err(Error::Parameters {
                found: p.len(),
                expected: free.len(),
            });
        }
        let mut delta = vec![0.0; self.cols()];
        for (column, p) in free.iter().zip(p) {
            delta[*column] = *p;
        }
        Ok(self.retract_from_start(&delta))
    }
}
