//! What the estimate would have been without some of the measurements, and how it predicts these.

use super::clusters::clusters;
use super::uncertainty::Judged;
use crate::error::Error;
use crate::estimate::Job;
use crate::unknown::State;
use truing::nalgebra::{Cholesky, DMatrix, DVector};
use truing::{LeastSquares, Linearization, Problem};

/// What the other measurements determine by less than this part of all of them, for each unknown, is as good as free
/// without them: rounding.
const SINGULAR: f64 = 64.0 * f64::EPSILON;

/// Squared errors below this part of all of them are rounding.
const ROUNDING: f64 = 1e-18;

/// By how much better some measurements are predicted by one robot than by another, cluster after cluster of postures.
#[derive(Debug, Clone, Default)]
pub(crate) struct Comparison {
    /// Logarithms of the ratio of RMS errors, this robot's over the other's.
    logs: Vec<f64>,
}

impl Comparison {
    /// From the squared errors of both in every cluster.
    pub fn of(squares: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        // Where there is nothing but rounding neither is better.
        let rounding = ROUNDING * squares.clone().map(|(a, b)| a + b).sum::<f64>();
        let log = |x: f64| 0.5 * (x + rounding).max(f64::MIN_POSITIVE).ln();
        Self {
            logs: squares.map(|(a, b)| log(a) - log(b)).collect(),
        }
    }

    /// Adds the clusters of another set.
    pub fn append(&mut self, other: Self) {
        self.logs.extend(other.logs);
    }

    /// How many clusters were compared.
    pub fn clusters(&self) -> usize {
        self.logs.len()
    }

    /// Ratio of the errors, as the geometric mean over clusters.
    pub fn ratio(&self) -> f64 {
        self.mean().exp()
    }

    /// By how many standard errors this robot is the better one: the mean logarithm of the ratio beside its scatter
    /// over clusters, in which neither an outlier nor a unit counts. NaN if there is nothing to compare.
    pub fn gain(&self) -> f64 {
        let (n, mean) = (self.logs.len() as f64, self.mean());
        let squares: f64 = self.logs.iter().map(|log| (log - mean).powi(2)).sum();
        -mean / (squares / (n - 1.0) / n).sqrt()
    }

    fn mean(&self) -> f64 {
        self.logs.iter().sum::<f64>() / self.logs.len() as f64
    }
}

/// Clusters of measurements, each left out in turn.
pub(crate) struct LeftOut {
    /// Predictions of the left-out measurements beside those of the registered nominal robot.
    pub comparison: Comparison,
    /// How the estimate changes without each cluster, a number for every free column.
    pub shifts: Vec<DVector<f64>>,
}

/// The linear model of a calibration at its solution, to leave measurements out of.
pub(crate) struct LinearModel<'a> {
    job: &'a Job,
    problem: &'a Problem,
    lin: Linearization,
    /// Whitened residuals of the registered nominal robot.
    registered: Vec<f64>,
    /// Square roots of what robust losses weigh rows with.
    weight: Vec<f64>,
    /// The free columns.
    pub free: Vec<usize>,
}

impl<'a> LinearModel<'a> {
    /// At the solution that was judged, with the residuals of the registered nominal robot to compare with.
    pub fn new(job: &'a Job, judged: &'a Judged, registered: &State) -> Result<Self, Error> {
        let problem = &judged.assembly.problem;
        let mut lin = Linearization::new(problem.structure());
        problem.linearize(problem.initial(), &mut lin);
        let mut weight = vec![1.0; problem.rows()];
        for (k, (set, block)) in job.sets.iter().zip(problem.blocks()).enumerate() {
            for item in problem.block_rows(k).step_by(block.dim()) {
                let item = item..item + block.dim();
                let s = lin.residual[item.clone()].iter().map(|r| r * r).sum();
                let (_, slope, _) = set.loss.evaluate(s);
                weight[item].fill(slope.max(0.0).sqrt());
            }
        }
        Ok(Self {
            job,
            registered: job.whitened(registered)?,
            free: problem.free(),
            problem,
            lin,
            weight,
        })
    }

    /// Leaves every cluster out in turn: with A = JᵀJ, δ₋c = (A − JcᵀJc)⁻¹ Jcᵀ rc, and its rows are predicted with
    /// rc + Jc δ₋c. There are at most `most` clusters a set.
    pub fn leave_out(&self, most: usize) -> LeftOut {
        let mut rows: Vec<Vec<usize>> = Vec::new();
        for (k, (set, block)) in self.job.sets.iter().zip(self.problem.blocks()).enumerate() {
            let own = clusters(&self.job.arms, set, most);
            let (first, count) = (rows.len(), own.iter().max().map_or(0, |last| last + 1));
            rows.resize(first + count, Vec::new());
            let items = self.problem.block_rows(k).step_by(block.dim());
            for (item, row) in items.enumerate() {
                // Equations that leave unknowns out are about several measurements: parts of their list.
                let cluster = if block.len() == set.len() {
                    own[item]
                } else {
                    item * count / block.len()
                };
                rows[first + cluster].extend(row..row + block.dim());
            }
        }
        let n = self.free.len();
        let (jacobians, mut all) = self.jacobians(&rows);
        jacobians.iter().for_each(|j| all.gemm_tr(1.0, j, j, 1.0));
        let scale = all.diagonal().map(|a| if a > 0.0 { a.sqrt() } else { 1.0 });
        let (mut squares, mut shifts) = (Vec::new(), Vec::new());
        for (rows, j) in rows.iter().zip(&jacobians) {
            let weighted = |of: &[f64]| {
                let of = rows.iter().map(|row| self.weight[*row] * of[*row]);
                DVector::from_iterator(rows.len(), of)
            };
            let (r, nominal) = (weighted(&self.lin.residual), weighted(&self.registered));
            let mut rest = all.clone();
            rest.gemm_tr(-1.0, j, j, 1.0);
            for i in 0..n {
                (0..n).for_each(|k| rest[(i, k)] /= scale[i] * scale[k]);
                rest[(i, i)] += SINGULAR * n as f64;
            }
            // What cannot be predicted is no better than chance.
            let shift = match Cholesky::new(rest) {
                Some(factor) => factor
                    .solve(&j.tr_mul(&r).component_div(&scale))
                    .component_div(&scale),
                None => DVector::from_element(n, f64::NAN),
            };
            squares.push(((&r + j * &shift).norm_squared(), nominal.norm_squared()));
            shifts.push(shift);
        }
        LeftOut {
            comparison: Comparison::of(squares.into_iter()),
            shifts,
        }
    }

    /// The weighted Jacobian of every cluster's rows, and JᵀJ of the priors, which belong to none.
    fn jacobians(&self, clusters: &[Vec<usize>]) -> (Vec<DMatrix<f64>>, DMatrix<f64>) {
        let n = self.free.len();
        let mut places = vec![None; self.problem.rows()];
        for (cluster, rows) in clusters.iter().enumerate() {
            for (place, row) in rows.iter().enumerate() {
                places[*row] = Some((cluster, place));
            }
        }
        let blank = |rows: &Vec<usize>| DMatrix::zeros(rows.len(), n);
        let mut jacobians: Vec<DMatrix<f64>> = clusters.iter().map(blank).collect();
        let measured: usize = clusters.iter().map(Vec::len).sum();
        let mut priors = DMatrix::zeros(self.problem.rows() - measured, n);
        for (k, column) in self.free.iter().enumerate() {
            for (row, value) in self.lin.column(*column) {
                match places[row] {
                    Some((cluster, place)) => {
                        jacobians[cluster][(place, k)] = self.weight[row] * value;
                    }
                    // Priors stand behind all measurements.
                    None => priors[(row - measured, k)] = value,
                }
            }
        }
        (jacobians, priors.tr_mul(&priors))
    }
}
