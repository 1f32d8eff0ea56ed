//! Which unknowns go up and down together.

use super::Covariance;
use crate::least_squares::LeastSquares;
use nalgebra::DMatrix;

/// Two columns and how far they depend on each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Correlation {
    /// The columns, the first before the second.
    pub columns: (usize, usize),
    /// Their names, as the problem describes them.
    pub names: (String, String),
    /// ρ, from −1 to 1.
    pub coefficient: f64,
}

impl Covariance {
    /// Correlation ρ = Σₐᵦ / (σₐ σᵦ) of two columns, from −1 to 1; zero where one of them is fixed or
    /// cannot move.
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        coefficient(self.entry(a, b), self.std_dev(a), self.std_dev(b))
    }

    /// Correlations of all free columns (free × free), in their order, ones on the diagonal.
    pub fn correlations(&self) -> DMatrix<f64> {
        let mut matrix = self.matrix();
        let deviations: Vec<f64> = matrix.diagonal().iter().map(|v| v.sqrt()).collect();
        for k in 0..matrix.ncols() {
            for i in 0..matrix.nrows() {
                matrix[(i, k)] = if i == k {
                    1.0
                } else {
                    coefficient(matrix[(i, k)], deviations[i], deviations[k])
                };
            }
        }
        matrix
    }

    /// The pairs of free columns with |ρ| above `least`, the strongest first, with their names in
    /// `problem`.
    ///
    /// A pair at ±1 says that the data know the one only if the other is known: their standard
    /// deviations are both large, and a combination of them is known much better than either.
    pub fn strongest_correlations<P: LeastSquares>(
        &self,
        problem: &P,
        least: f64,
    ) -> Vec<Correlation> {
        let matrix = self.correlations();
        let mut pairs = Vec::new();
        for k in 0..matrix.ncols() {
            for i in 0..k {
                if matrix[(i, k)].abs() > least {
                    pairs.push((i, k, matrix[(i, k)]));
                }
            }
        }
        // Stable: equally strong pairs stay in the order of their columns.
        pairs.sort_by(|a, b| f64::total_cmp(&b.2.abs(), &a.2.abs()));
        let free = self.free();
        let named = |(i, k, coefficient)| Correlation {
            columns: (free[i], free[k]),
            names: (
                problem.describe_column(free[i]),
                problem.describe_column(free[k]),
            ),
            coefficient,
        };
        pairs.into_iter().map(named).collect()
    }
}

/// ρ, within −1 and 1 though rounding may have it otherwise.
fn coefficient(covariance: f64, a: f64, b: f64) -> f64 {
    if a > 0.0 && b > 0.0 {
        (covariance / a / b).clamp(-1.0, 1.0)
    } else {
        0.0
    }
}
