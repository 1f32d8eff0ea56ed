//! A search for a start: the problem, what it took so far, plain fits and what they are worth.

use super::job::Job;
use crate::error::Error;
use crate::measurement::MeasurementSet;
use crate::model::Assembly;
use crate::robot::Arm;
use crate::unknown::State;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use truing::solver::{Evaluations, run};
use truing::{LeastSquares, Linearization, Settings, Tolerances, Values};

/// A fit is right if its weighted residuals are at most so many standard deviations, RMS.
pub const GOOD: f64 = 3.0;
/// The residuals of a robot that has collapsed hardly depend on its joints: by less than this part of
/// what they do at nominal.
pub const THIN: f64 = 0.1;

/// The problem under robust losses.
pub(crate) struct Robust<'a> {
    /// Under those of the file.
    pub stated: &'a Assembly,
    /// Under convex ones in their place.
    pub convex: Assembly,
}

/// The time that is left until then.
pub fn left(deadline: Instant) -> Duration {
    deadline.saturating_duration_since(Instant::now())
}

pub(crate) struct Search<'a> {
    pub job: &'a Job,
    pub assembly: &'a Assembly,
    /// The same with robust losses, if there are any.
    pub robust: Option<Robust<'a>>,
    /// Estimated parameters of robots: robot, parameter, and what a radian is worth in its unit.
    pub estimated: Vec<(usize, usize, f64)>,
    pub reach: f64,
    /// RMS standard deviation of lengths \[m\].
    pub sigma: f64,
    pub evaluations: Evaluations,
    pub iterations: u64,
    pub deadline: Option<Instant>,
}

impl Search<'_> {
    /// Plain steps.
    pub fn solve(&mut self, from: &Values, iterations: u64) -> Result<(Values, f64), Error> {
        let settings = self.settings(Tolerances::default().cost, iterations);
        let outcome = run(&self.assembly.problem, from.clone(), &settings)?;
        self.count(outcome.evaluations, outcome.iterations);
        Ok((outcome.point, outcome.cost))
    }

    pub fn settings(&self, cost: f64, iterations: u64) -> Settings {
        Settings {
            tolerances: Tolerances {
                cost,
                max_iterations: iterations,
                ..Tolerances::default()
            },
            interrupt: self.job.estimate.settings.interrupt.clone(),
            timeout: self.deadline.map(left),
            ..Settings::default()
        }
    }

    pub fn count(&mut self, evaluations: Evaluations, iterations: u64) {
        self.evaluations.residual += evaluations.residual;
        self.evaluations.jacobian += evaluations.jacobian;
        self.iterations += iterations;
    }

    /// RMS of the weighted residuals of measurements: what priors cost is no noise.
    pub fn rms(&self, x: &Values, cost: f64) -> f64 {
        let problem = &self.assembly.problem;
        let sets = self.job.sets.len();
        let priors: f64 = problem
            .blocks()
            .skip(sets)
            .map(|block| {
                let mut r = vec![0.0; block.len() * block.dim()];
                block.residual(x.as_slice(), 1.0, &mut r)
            })
            .sum();
        let rows: usize = (0..sets).map(|k| problem.block_rows(k).len()).sum();
        (2.0 * (cost - priors).max(0.0) / rows.max(1) as f64).sqrt()
    }

    /// RMS of what the joints change in the weighted residuals.
    pub fn slope(&mut self, x: &Values) -> f64 {
        self.evaluations.jacobian += 1;
        slope(&self.job.arms, self.assembly, x)
    }

    /// Whether someone stopped it, or the time ran out.
    pub fn stopped(&self) -> bool {
        let flag = self.job.estimate.settings.interrupt.as_ref();
        flag.is_some_and(|flag| flag.load(Ordering::SeqCst))
            || self
                .deadline
                .is_some_and(|deadline| Instant::now() > deadline)
    }
}

/// RMS of what the joints change in the weighted residuals at a point.
pub fn slope(arms: &[Arm], assembly: &Assembly, x: &Values) -> f64 {
    let mut lin = Linearization::new(assembly.problem.structure());
    assembly.problem.linearize(x, &mut lin);
    let mut squares = 0.0;
    for (r, arm) in arms.iter().enumerate() {
        for joint in arm.robot.joints() {
            // A frame from outside has no parameter that does what its joint does.
            let Some(offset) = joint.offset_parameter else {
                continue;
            };
            let column = assembly.robot(r).column() + offset;
            squares += lin.column_norm(column).powi(2);
        }
    }
    (squares / assembly.problem.rows() as f64).sqrt()
}

impl Job {
    /// Whether the measurements hardly depend on the joints any more: an arm that has collapsed, or whose
    /// axes are all parallel, fits any touches. Seen in metres, whatever the equations and the loss of
    /// the estimate are.
    pub fn has_collapsed(&self, before: &State, estimate: &State) -> Result<bool, Error> {
        let plain = self.sets.iter().map(|set| set.plain().unweighted());
        let plain: Vec<MeasurementSet> = plain.collect();
        let slope = |state: &State| -> Result<f64, Error> {
            let derivatives = &self.estimate.derivatives;
            let assembly = Assembly::new(&self.arms, &plain, state, derivatives)?;
            Ok(super::search::slope(
                &self.arms,
                &assembly,
                assembly.problem.initial(),
            ))
        };
        Ok(slope(estimate)? < THIN * slope(before)?)
    }
}
