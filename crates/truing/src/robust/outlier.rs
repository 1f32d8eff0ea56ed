//! Which measurements a robust loss has set aside.

use crate::block::ConstraintBlock;
use crate::loss::Loss;
use crate::problem::Problem;
use crate::variable::Values;

/// How much one measurement counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weight {
    /// Norm ‖r‖ of the whitened residual, in standard deviations.
    pub norm: f64,
    /// Weight ρ′(‖r‖²) that the loss gives it, between 0 and 1.
    pub weight: f64,
}

/// A measurement that a robust loss has set aside: see [`Weight::is_outlier`].
#[derive(Debug, Clone, PartialEq)]
pub struct Outlier {
    /// Number of the block, as in [`Problem::blocks`].
    pub block: usize,
    /// Number of the constraint in the block.
    pub item: usize,
    /// Norm ‖r‖ of the whitened residual, in standard deviations.
    pub norm: f64,
    /// Weight ρ′(‖r‖²) that the loss gives it.
    pub weight: f64,
}

impl Weight {
    /// Whether a measurement of `dim` rows is an outlier: it counts less than half, and its norm is one
    /// that normal noise exceeds once in a thousand measurements.
    ///
    /// The first alone would name good measurements under a loss with a small scale, the second alone
    /// measurements that a loss with a large scale counts all the same.
    pub fn is_outlier(&self, dim: usize) -> bool {
        self.weight < 0.5 && self.norm * self.norm > rare(dim)
    }
}

/// The squared norm of `dim` normal numbers that is exceeded once in a thousand: the 99.9 % quantile of
/// χ², to 3 % (Wilson & Hilferty 1931).
fn rare(dim: usize) -> f64 {
    const QUANTILE: f64 = 3.0902;
    let k = dim.max(1) as f64;
    let variance = 2.0 / (9.0 * k);
    k * (1.0 - variance + QUANTILE * variance.sqrt()).powi(3)
}

impl Problem {
    /// How much every measurement counts at `x`: for each block, for each of its constraints.
    pub fn weights(&self, x: &Values) -> Vec<Vec<Weight>> {
        self.blocks().map(|block| weights(block, x)).collect()
    }

    /// The measurements that robust losses set aside at `x`, block after block.
    pub fn outliers(&self, x: &Values) -> Vec<Outlier> {
        let robust = self
            .blocks()
            .enumerate()
            .filter(|(_, block)| block.loss() != Loss::Trivial);
        robust
            .flat_map(|(number, block)| {
                let dim = block.dim();
                let all = weights(block, x).into_iter().enumerate();
                all.filter(move |(_, w)| w.is_outlier(dim))
                    .map(move |(item, w)| Outlier {
                        block: number,
                        item,
                        norm: w.norm,
                        weight: w.weight,
                    })
            })
            .collect()
    }
}

impl Problem {
    /// Residuals of a block in standard deviations, neither weighted nor multiplied by its loss.
    #[track_caller]
    pub(crate) fn whitened(&self, block: usize, x: &Values) -> Vec<f64> {
        match self.blocks().nth(block) {
            Some(block) => whitened(block, x),
            None => panic!("there is no block {block}"),
        }
    }
}

fn whitened(block: &dyn ConstraintBlock, x: &Values) -> Vec<f64> {
    let mut r = vec![0.0; block.len() * block.dim()];
    block.residual(x.as_slice(), f64::INFINITY, &mut r);
    let root = block.weight().sqrt();
    r.iter_mut().for_each(|r| *r /= root);
    r
}

fn weights(block: &dyn ConstraintBlock, x: &Values) -> Vec<Weight> {
    let dim = block.dim();
    if dim == 0 {
        return vec![
            Weight {
                norm: 0.0,
                weight: 1.0
            };
            block.len()
        ];
    }
    whitened(block, x)
        .chunks_exact(dim)
        .map(|r| {
            // Scaled, so that a huge residual has a norm.
            let largest = r.iter().fold(0.0_f64, |m, r| m.max(r.abs()));
            let squares: f64 = r.iter().map(|r| (r / largest) * (r / largest)).sum();
            let norm = if largest > 0.0 {
                largest * squares.sqrt()
            } else {
                r.iter().sum::<f64>()
            };
            Weight {
                norm,
                weight: block.loss().evaluate(norm * norm).1,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of χ² as tabulated (Abramowitz & Stegun, table 26.8, Q = 0.001).
    #[test]
    fn rare_norms_are_those_of_the_table() {
        for (dim, quantile) in [
            (1, 10.828),
            (2, 13.816),
            (3, 16.266),
            (6, 22.458),
            (30, 59.703),
        ] {
            let ratio = rare(dim) / quantile;
            assert!((ratio - 1.0).abs() < 0.035, "{dim}: {ratio}");
        }
    }
}
