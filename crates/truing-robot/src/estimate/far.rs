//! Estimates that start far from the truth: a short plain fit and, where it fails visibly,
//! continuations from nominal and from places near it.
//!
//! The minima that plain steps run into are arms that have shrunk, or whose axes have turned
//! parallel: whatever their joints do, their tools stay near any plane. So touches are measured in
//! joint space, where shrinking gains nothing ([`Tempered`]), and the parameters are drawn to where
//! they start, strongly first, then ever less. What fits at the end is then estimated as ever.

use super::calibration::Strategy;
use super::job::Job;
use super::search::{GOOD, Robust, Search, THIN};
use super::tempered::{Pull, Tempered};
use super::touches::Touches;
use crate::error::Error;
use crate::identify::Choice;
use crate::measurement::MeasurementSet;
use crate::model::{Assembly, Owner};
use crate::robot::Unit;
use crate::start::start;
use crate::unknown::State;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::time::Instant;
use truing::solver::{Evaluations, run};
use truing::{LeastSquares, Method, Values};

/// The nominal robot is far from what was measured if the median error of a set is more than this
/// part of its reach.
const FAR: f64 = 0.01;
/// Iterations of the plain fit that is tried first.
const PROBE: u64 = 10;
/// Starts, nominal included.
const STARTS: usize = 60;
/// The same under robust losses: each start takes several times as long.
const ROBUST_STARTS: usize = 20;
/// Strengths of the pull, each a third of the one before: the first is one metre of residual a
/// radian.
const STAGES: usize = 11;
const FALL: f64 = 3.0;
/// How well, and in how many iterations, each stage is solved.
const LOOSE: f64 = 1e-2;
const ITERATIONS: u64 = 4;
/// From the fourth stage on a residual that falls by less is stuck.
const STUCK: f64 = 0.8;
const WARM: usize = 3;
/// Iterations of the plain fit at the end of a continuation, and how often they are granted again
/// while they halve the cost: long valleys.
const LAST: u64 = 20;
const AGAIN: usize = 5;
/// Other starts than nominal: uniform, ± this [rad], and this part of the reach for lengths.
const SPREAD: f64 = 0.3;
const SPREAD_OF_LENGTHS: f64 = 0.6;
/// Costs of two fits that agree to this are of the same minimum.
const SAME: f64 = 1e-3;

/// A plain fit whose weighted residuals are less is followed to its end before others are tried.
const NEAR: f64 = 30.0;

/// Where an estimate should start, and what it took to find out.
pub(crate) struct Found {
    /// The start.
    pub values: Values,
    /// Evaluations used.
    pub evaluations: Evaluations,
    /// Iterations used.
    pub iterations: u64,
    /// Continuations tried; none if the plain fit did it.
    pub starts: usize,
    /// Whether it fits to the noise, or two starts led to it.
    pub sure: bool,
    /// Whether the search was stopped, by someone or by the time.
    pub stopped: bool,
    /// RMS of the weighted residuals.
    pub rms: f64,
}

impl Job {
    /// Looks for a start from which the plain estimate converges to the robot that was measured;
    /// `None` where nominal will do: it is near, or the file asks for plain steps, other equations,
    /// or bounds on what is estimated, inside which nothing is far.
    ///
    /// The search takes no robust loss: one would weigh touches by how far the start is off. But where
    /// there is one, a fit is also right if the robust estimate that starts there is down to the noise in
    /// most measurements.
    pub fn far_start(
        &self,
        from: &State,
        assembly: &Assembly,
        choices: &[Choice],
        deadline: Option<Instant>,
    ) -> Result<Option<Found>, Error> {
        let is_estimated =
            |r: usize, p: usize| choices[assembly.robot(r).column() + p] == Choice::Estimated;
        let mut bounds = self.estimate.bounds.iter();
        let bounded = bounds.any(|(r, p, ..)| is_estimated(*r, *p));
        let plain = self.estimate.strategy == Strategy::Auto
            && self.estimate.from.is_none()
            && self.estimate.settings.method == Method::LevenbergMarquardt
            && !bounded
            && self.sets.iter().all(|set| set.method.is_none());
        if !plain {
            return Ok(None);
        }
        let reach = self.reach();
        if self.misfit(from)? <= FAR * reach {
            return Ok(None);
        }
        let unweighted = Self {
            sets: self.sets.iter().map(MeasurementSet::unweighted).collect(),
            ..self.clone()
        };
        let plain = unweighted.columns_assembled(from, choices, true, &[])?;
        let robust = if assembly.problem.is_robust() {
            let convex = self.convex().columns_assembled(from, choices, true, &[])?;
            let stated = assembly;
            Some(Robust { stated, convex })
        } else {
            None
        };
        unweighted.search(&plain, robust, choices, reach, deadline)
    }

    fn search(
        &self,
        assembly: &Assembly,
        robust: Option<Robust<'_>>,
        choices: &[Choice],
        reach: f64,
        deadline: Option<Instant>,
    ) -> Result<Option<Found>, Error> {
        let mut estimated = Vec::new();
        for (c, column) in assembly.columns.iter().enumerate() {
            if let (Choice::Estimated, Owner::Parameter { robot, parameter }) =
                (&choices[c], &column.owner)
            {
                let unit = self.arms[*robot].robot.parameters()[*parameter].unit();
                let worth = if unit == Unit::Meter { reach } else { 1.0 };
                estimated.push((*robot, *parameter, worth));
            }
        }
        if estimated.is_empty() {
            return Ok(None);
        }
        let sigmas = (self.sets.iter())
            .flat_map(|set| (0..set.len()).filter_map(|row| set.length_sigma(row)));
        let (sum, count) = sigmas.fold((0.0, 0.0), |(sum, n), s| (sum + s * s, n + 1.0));
        let search = Search {
            job: self,
            assembly,
            robust,
            estimated,
            reach,
            sigma: (sum / f64::max(count, 1.0)).sqrt(),
            evaluations: Evaluations::default(),
            iterations: 0,
            deadline,
        };
        search.run().map(Some)
    }
}

impl Search<'_> {
    fn run(mut self) -> Result<Found, Error> {
        let nominal = self.assembly.problem.initial().clone();
        let slope = self.slope(&nominal);
        let (probe, cost) = self.solve(&nominal, PROBE)?;
        let ((mut probe, mut cost), accepted) = self.accept(probe, cost, slope)?;
        if accepted {
            return Ok(self.found(probe, cost, 0, true));
        }
        let mut fits = vec![];
        if self.robust.is_none() && self.rms(&probe, cost) < NEAR {
            // Nearly there, perhaps as near as measurements that are worse than their σ allow.
            (probe, cost) = self.finish(probe, cost)?;
            if self.slope(&probe) > THIN * slope {
                fits.push((probe.clone(), cost));
            }
        }
        let mut abandoned: Option<(Values, f64)> = None;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut starts = 0;
        let most = if self.robust.is_some() {
            ROBUST_STARTS
        } else {
            STARTS
        };
        while starts < most && !self.stopped() {
            let begin = if starts == 0 {
                nominal.clone()
            } else {
                self.shifted(&mut rng)?
            };
            starts += 1;
            let best = fits
                .first()
                .map(|(x, cost): &(Values, f64)| self.rms(x, *cost));
            let (x, end) = self.descend(begin, best.unwrap_or_default())?;
            if let Some(left) = end {
                if abandoned.as_ref().is_none_or(|(_, best)| left < *best) {
                    abandoned = Some((x, left));
                }
                continue;
            }
            let ((x, cost), accepted) = if self.robust.is_some() {
                self.accept_robust(x, f64::INFINITY, slope)?
            } else {
                let (x, cost) = self.solve(&x, LAST)?;
                let (x, cost) = self.finish(x, cost)?;
                self.accept(x, cost, slope)?
            };
            if accepted {
                return Ok(self.found(x, cost, starts, true));
            }
            if self.slope(&x) > THIN * slope && self.is_of_most(&x) {
                fits.push((x, cost));
            }
            // Measurements may be worse than their σ says: then two starts that end alike decide.
            fits.sort_by(|a, b| a.1.total_cmp(&b.1));
            if let [(x, best), (_, next), ..] = &fits[..]
                && *next <= best * (1.0 + SAME)
            {
                let (x, best) = (x.clone(), *best);
                return Ok(self.found(x, best, starts, true));
            }
        }
        let (x, cost) = match (fits.into_iter().next(), abandoned) {
            (Some(fit), _) => fit,
            (None, Some((x, _))) => self.solve(&x, LAST)?,
            (None, None) => (probe, cost),
        };
        Ok(self.found(x, cost, starts, false))
    }

    /// Plain steps on along a valley, as long as they lead down and the noise is not reached.
    fn finish(&mut self, x: Values, cost: f64) -> Result<(Values, f64), Error> {
        let (mut x, mut cost) = (x, cost);
        for _ in 0..AGAIN {
            if self.rms(&x, cost) < GOOD || self.stopped() {
                break;
            }
            let before = cost;
            (x, cost) = self.solve(&x, LAST)?;
            if cost > 0.5 * before {
                break;
            }
        }
        Ok((x, cost))
    }

    fn found(&self, values: Values, cost: f64, starts: usize, sure: bool) -> Found {
        Found {
            rms: self.rms(&values, cost),
            values,
            evaluations: self.evaluations,
            iterations: self.iterations,
            starts,
            sure,
            stopped: !sure && self.stopped(),
        }
    }

    /// One continuation: the pull ever weaker, each stage from the last. Where the residual is stuck
    /// above the noise and above the `best` fit so far, it comes back with the point.
    fn descend(&mut self, begin: Values, best: f64) -> Result<(Values, Option<f64>), Error> {
        let (calibration, assembly) = (self.job, self.assembly);
        let touches = Touches::of(
            &calibration.arms,
            &calibration.sets,
            assembly,
            assembly.problem.initial(),
            self.reach,
        );
        let rows = assembly.problem.rows() as f64;
        let share = (rows / self.estimated.len() as f64).sqrt() / self.sigma;
        let pulls = self.estimated.iter().map(|(robot, parameter, worth)| Pull {
            robot: assembly.robot(*robot),
            parameter: *parameter,
            center: begin.raw(assembly.robot(*robot))[*parameter],
            weight: share / worth,
        });
        let mut tempered = Tempered::new(&assembly.problem, &touches, pulls.collect());
        let settings = self.settings(LOOSE, ITERATIONS);
        let (mut x, mut before) = (begin, f64::INFINITY);
        for stage in 0..STAGES {
            let outcome = run(&tempered, x, &settings)?;
            self.count(outcome.evaluations, outcome.iterations);
            x = outcome.point;
            let left = self.rms(&x, outcome.cost - tempered.pulled(&x));
            // Outliers keep any residual up.
            let stuck = self.robust.is_none() && stage >= WARM;
            if stuck && left > STUCK * before && left > 2.0 * GOOD.max(best) {
                return Ok((x, Some(left)));
            }
            before = left;
            for pull in &mut tempered.pulls {
                pull.weight /= FALL.sqrt();
            }
        }
        Ok((x, None))
    }

    /// Nominal but for random changes of everything estimated, with frames, planes and points fitted.
    fn shifted(&self, rng: &mut ChaCha8Rng) -> Result<Values, Error> {
        let calibration = self.job;
        let nominal = self.assembly.state(self.assembly.problem.initial());
        let mut robots = nominal.robots.clone();
        for (robot, parameter, worth) in &self.estimated {
            let unit = calibration.arms[*robot].robot.parameters()[*parameter].unit();
            if matches!(unit, Unit::Other(_)) {
                continue;
            }
            let length = unit == Unit::Meter;
            let spread = if length { SPREAD_OF_LENGTHS } else { SPREAD };
            robots[*robot][*parameter] += spread * worth * rng.random_range(-1.0..1.0);
        }
        let state = start(&calibration.arms, &calibration.sets, robots, &nominal);
        let derivatives = &calibration.estimate.derivatives;
        let shifted = Assembly::new(&calibration.arms, &calibration.sets, &state, derivatives)?;
        Ok(shifted.problem.initial().clone())
    }

    /// A fit down to the noise is solved to the last digit; it counts if its residuals still depend on
    /// the angles.
    fn accept(&mut self, x: Values, cost: f64, slope: f64) -> Result<((Values, f64), bool), Error> {
        if self.rms(&x, cost) > GOOD {
            return self.accept_robust(x, cost, slope);
        }
        let (x, cost) = self.solve(&x, 5 * LAST)?;
        let accepted = self.rms(&x, cost) <= GOOD && self.slope(&x) > THIN * slope;
        Ok(((x, cost), accepted))
    }
}
