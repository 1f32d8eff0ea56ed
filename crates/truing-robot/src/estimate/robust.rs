//! Far starts under robust losses: outliers keep every fit above the noise, so it is the robust estimate
//! from a fit that tells whether it is right.

use super::job::Job;
use super::search::{GOOD, Robust, Search, THIN, left};
use crate::error::Error;
use crate::measurement::MeasurementSet;
use truing::solver::run;
use truing::{Loss, Settings, Tolerances, Values, solve_graduated_from};

/// Iterations of a robust estimate that is tried from a fit.
const ROBUST: u64 = 200;

impl Job {
    /// The same with soft L1 in place of every robust loss.
    pub fn convex(&self) -> Self {
        let set = |set: &MeasurementSet| match set.loss {
            Loss::Trivial => set.clone(),
            _ => set.clone().loss(Loss::SoftL1(1.0)),
        };
        Self {
            sets: self.sets.iter().map(set).collect(),
            ..self.clone()
        }
    }
}

impl Search<'_> {
    /// Where a loss is robust, outliers may keep a fit above the noise: the robust estimate from there takes
    /// its place, and counts if it is down to the noise in most measurements.
    ///
    /// Two are tried. Graduated non-convexity sets out from least squares, which outliers about as large
    /// as the errors of the nominal robot lead astray; soft L1, whose estimate the loss as stated then
    /// finishes, is led less, but it sets out with all the errors of the nominal robot weighed down.
    pub fn accept_robust(
        &mut self,
        x: Values,
        cost: f64,
        slope: f64,
    ) -> Result<((Values, f64), bool), Error> {
        let Some(robust) = &self.robust else {
            return Ok(((x, cost), false));
        };
        let settings = self.settings(Tolerances::default().cost, ROBUST);
        let graduated = solve_graduated_from(&robust.stated.problem, &x, &settings)?;
        let mut best = (graduated.values, graduated.cost);
        let mut counts = vec![(graduated.evaluations, graduated.iterations)];
        let mut middle = self.middle(&best.0);
        if middle > GOOD && !self.stopped() {
            let settings = Settings {
                timeout: self.deadline.map(left),
                ..settings
            };
            let convex = run(&robust.convex.problem, x, &settings)?;
            counts.push((convex.evaluations, convex.iterations));
            let finished = run(&robust.stated.problem, convex.point, &settings)?;
            counts.push((finished.evaluations, finished.iterations));
            if finished.cost < best.1 {
                best = (finished.point, finished.cost);
                middle = self.middle(&best.0);
            }
        }
        for (evaluations, iterations) in counts {
            self.count(evaluations, iterations);
        }
        let accepted = middle <= GOOD && self.slope(&best.0) > THIN * slope;
        Ok((best, accepted))
    }

    /// Whether a robust fit is one of most measurements: those that set nearly all aside have all the
    /// same cost.
    pub fn is_of_most(&self, x: &Values) -> bool {
        let aside = |robust: &Robust<'_>| robust.stated.problem.outliers(x).len();
        let all: usize = self.job.sets.iter().map(MeasurementSet::len).sum();
        2 * self.robust.as_ref().map_or(0, aside) < all
    }

    /// The size of the weighted residuals that half of the measurements stay below, 1 for noise as
    /// stated: medians of χ² are about n (1 − 2/9n)³ (Wilson & Hilferty 1931).
    fn middle(&self, x: &Values) -> f64 {
        let problem = &self.assembly.problem;
        let weights = problem.weights(x).into_iter();
        let blocks = problem.blocks().zip(weights);
        let mut sizes: Vec<f64> = blocks
            .take(self.job.sets.len())
            .flat_map(|(block, weights)| {
                let n = block.dim().max(1) as f64;
                let median = (n * (1.0 - 2.0 / (9.0 * n)).powi(3)).sqrt();
                weights.into_iter().map(move |w| w.norm / median)
            })
            .collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).copied().unwrap_or_default()
    }
}
