//! What the estimate would have been without some of the measurements, and how it predicts these.

use super::clusters::clusters;
use super::uncertainty::Judged;
use crate::error::Error;
use crate::estimate::Job;
use crate::measurement::MeasurementSet;
use crate::model::Assembly;
use crate::unknown::State;
use truing::nalgebra::{Cholesky, DMatrix, DVector};
use truing::{LeastSquares, Linearization};

/// A cluster of measurements that was left out.
pub(crate) struct LeftOut {
    /// Their squared whitened residuals as predicted from all other measurements.
    pub predicted: f64,
    /// The same of the registered nominal robot.
    pub registered: f64,
    /// How the estimate changes without them, a number for every free column.
    pub shift: DVector<f64>,
}

/// All clusters, each left out in turn.
pub(crate) struct LeaveOut {
    pub clusters: Vec<LeftOut>,
    /// The columns that shifts are of.
    pub free: Vec<usize>,
}

impl LeaveOut {
    /// By how many standard errors the calibrated robot predicts measurements that it was not estimated from better
    /// than the registered nominal one: the mean over clusters of the logarithm of the ratio of errors, in which neither
    /// an outlier nor a unit counts, beside its scatter.
    pub fn gain(&self) -> f64 {
        let n = self.clusters.len() as f64;
        let scatter = self
            .logs()
            .map(|log| (log - self.mean()).powi(2))
            .sum::<f64>()
            / (n - 1.0);
        -self.mean() / (scatter / n).sqrt()
    }

    /// Ratio of the errors, calibrated over registered, as the geometric mean over clusters.
    pub fn ratio(&self) -> f64 {
        self.mean().exp()
    }

    fn mean(&self) -> f64 {
        self.logs().sum::<f64>() / self.clusters.len() as f64
    }

    fn logs(&self) -> impl Iterator<Item = f64> {
        let all: f64 = self
            .clusters
            .iter()
            .map(|c| c.predicted + c.registered)
            .sum();
        // Where there is nothing but rounding neither is better.
        let size = move |squares: f64| (squares + ROUNDING * all).max(f64::MIN_POSITIVE).ln();
        (self.clusters.iter()).map(move |c| 0.5 * (size(c.predicted) - size(c.registered)))
    }
}

impl Job {
    /// Leaves every cluster of postures out in turn, by the linear model at the solution: with A = JᵀJ,
    /// δ₋c = (A − JcᵀJc)⁻¹ Jcᵀ rc, and its rows are predicted with rc + Jc δ₋c. Robust losses weigh.
    pub fn leave_out(
        &self,
        judged: &Judged,
        registered: &State,
        most: usize,
    ) -> Result<LeaveOut, Error> {
        let problem = &judged.assembly.problem;
        let free = problem.free();
        let mut lin = Linearization::new(problem.structure());
        problem.linearize(problem.initial(), &mut lin);
        let plain: Vec<MeasurementSet> = self.sets.iter().map(MeasurementSet::unweighted).collect();
        let base = Assembly::new(&self.arms, &plain, registered, &self.estimate.derivatives)?;
        let mut nominal = vec![0.0; base.problem.rows()];
        base.problem.residual(base.problem.initial(), &mut nominal);

        // Every row's cluster and weight; priors belong to none.
        let mut of_row = vec![usize::MAX; problem.rows()];
        let mut weight = vec![1.0; problem.rows()];
        let mut count = 0;
        for (k, (set, block)) in self.sets.iter().zip(problem.blocks()).enumerate() {
            let rows = problem.block_rows(k);
            let own = clusters(&self.arms, set, most);
            let clusters = own.iter().max().map_or(0, |last| last + 1);
            for (item, row) in rows.clone().step_by(block.dim()).enumerate() {
                // Equations that leave unknowns out are about several measurements: parts of their list.
                let cluster = if block.len() == set.len() {
                    own[item]
                } else {
                    item * clusters / block.len()
                };
                let item_rows = row..row + block.dim();
                let s: f64 = lin.residual[item_rows.clone()].iter().map(|r| r * r).sum();
                let (_, slope, _) = set.loss.evaluate(s);
                for row in item_rows {
                    of_row[row] = count + cluster;
                    weight[row] = slope.max(0.0).sqrt();
                }
            }
            count += clusters;
        }
        let mut places = vec![Vec::new(); count];
        let mut place = vec![0; problem.rows()];
        for (row, cluster) in of_row.iter().enumerate() {
            if let Some(rows) = places.get_mut(*cluster) {
                place[row] = rows.len();
                rows.push(row);
            }
        }
        let n = free.len();
        let mut jacobians: Vec<DMatrix<f64>> = places
            .iter()
            .map(|rows| DMatrix::zeros(rows.len(), n))
            .collect();
        let mut all = DMatrix::zeros(n, n);
        let mut of_priors: Vec<Vec<(usize, f64)>> = vec![Vec::new(); problem.rows()];
        for (k, column) in free.iter().enumerate() {
            for (row, value) in lin.column(*column) {
                match jacobians.get_mut(of_row[row]) {
                    Some(j) => j[(place[row], k)] = weight[row] * value,
                    None => of_priors[row].push((k, value)),
                }
            }
        }
        for row in &of_priors {
            for (i, a) in row {
                row.iter().for_each(|(k, b)| all[(*i, *k)] += a * b);
            }
        }
        let squares: Vec<DMatrix<f64>> = jacobians.iter().map(|j| j.tr_mul(j)).collect();
        squares.iter().for_each(|square| all += square);
        let scale: DVector<f64> = all.diagonal().map(|a| if a > 0.0 { a.sqrt() } else { 1.0 });

        let mut left_out = Vec::new();
        for ((rows, j), square) in places.iter().zip(&jacobians).zip(&squares) {
            let r = DVector::from_iterator(
                rows.len(),
                rows.iter().map(|row| weight[*row] * lin.residual[*row]),
            );
            let mut rest = &all - square;
            for i in 0..n {
                (0..n).for_each(|k| rest[(i, k)] /= scale[i] * scale[k]);
                rest[(i, i)] += SINGULAR;
            }
            let gradient = j.tr_mul(&r).component_div(&scale);
            let Some(factor) = Cholesky::new(rest) else {
                continue;
            };
            let shift = factor.solve(&gradient).component_div(&scale);
            let predicted = (&r + j * &shift).norm_squared();
            let registered = rows
                .iter()
                .map(|row| (weight[*row] * nominal[*row]).powi(2))
                .sum();
            left_out.push(LeftOut {
                predicted,
                registered,
                shift,
            });
        }
        Ok(LeaveOut {
            clusters: left_out,
            free,
        })
    }
}

/// What the other measurements determine by less than this part of all of them is as good as free without them.
const SINGULAR: f64 = 1e-12;

/// Squared errors below this part of all of them are rounding.
const ROUNDING: f64 = 1e-18;
