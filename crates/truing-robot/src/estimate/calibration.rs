//! Calibrations as plain data: robots, what was measured, what to estimate by name.

use crate::measurement::MeasurementSet;
use crate::robot::{Arm, Derivatives, Robot};
use truing::Settings;

/// How an estimate starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Strategy {
    /// At nominal; where the nominal robot is far from what was measured and the plain fit fails
    /// visibly, by continuation.
    #[default]
    Auto,
    /// At nominal, come what may.
    Direct,
}

/// What to estimate, and how. Parameters have the names, patterns and words that files use: `theta3`,
/// `left.d*`, `all`, `base`, `tool`, `gains`.
#[derive(Clone)]
pub struct Estimate {
    /// Which parameters are estimated, as far as the measurements identify them; all by default.
    pub parameters: Vec<String>,
    /// Those of them that are not.
    pub fixed: Vec<String>,
    /// Bounds on the difference from nominal: lower, upper [m, rad or 1].
    pub bounds: Vec<(String, f64, f64)>,
    /// Priors about nominal: one standard deviation [m, rad or 1].
    pub priors: Vec<(String, f64)>,
    /// How far robots may be from their drawings, as a part of their dimensions: what the data barely see is held
    /// there. None holds nothing; a part of 0.01 by default.
    pub drawing: Option<f64>,
    /// Parameters in order of preference; those left out follow in the default order.
    pub preference: Vec<String>,
    /// How constraints are differentiated.
    pub derivatives: Derivatives,
    /// How the problem is solved.
    pub settings: Settings,
    /// How it starts.
    pub strategy: Strategy,
    /// The robots that the estimate starts at, by plain steps, instead of the nominal ones: to see what
    /// the data allow where the truth is known.
    pub from: Option<Vec<Vec<f64>>>,
}

impl Default for Estimate {
    fn default() -> Self {
        Self {
            parameters: vec!["all".to_owned()],
            fixed: Vec::new(),
            bounds: Vec::new(),
            priors: Vec::new(),
            drawing: Some(0.01),
            preference: Vec::new(),
            derivatives: Derivatives::default(),
            settings: Settings::default(),
            strategy: Strategy::default(),
            from: None,
        }
    }
}

/// A calibration problem: robots, what was measured, what to estimate.
///
/// It is plain data that anyone may fill; [`run`](Self::run) checks all of it before anything is computed.
#[derive(Clone)]
pub struct Calibration {
    /// The robots.
    pub arms: Vec<Arm>,
    /// What to estimate from.
    pub sets: Vec<MeasurementSet>,
    /// Rows kept out of the estimate, with the number of the set they come from.
    pub held_out: Vec<(usize, MeasurementSet)>,
    /// Sets never used in the estimate; their own frames, tool points, planes and points are fitted
    /// to them with the robot as it is.
    pub validate: Vec<MeasurementSet>,
    /// What to estimate, and how.
    pub estimate: Estimate,
    /// What was noticed while the calibration was put together.
    pub notes: Vec<String>,
}

impl Calibration {
    /// A calibration of everything identifiable, by default settings.
    pub fn new(arms: Vec<Arm>, sets: Vec<MeasurementSet>) -> Self {
        Self {
            arms,
            sets,
            held_out: Vec::new(),
            validate: Vec::new(),
            estimate: Estimate::default(),
            notes: Vec::new(),
        }
    }

    /// A calibration of one robot, from what is added to it.
    pub fn of(robot: Robot) -> Self {
        Self::new(vec![Arm::only(robot)], Vec::new())
    }

    /// The same, estimated from these measurements too.
    #[must_use]
    pub fn measured(mut self, set: MeasurementSet) -> Self {
        self.sets.push(set);
        self
    }

    /// The same, estimated from these measurements too, but for the rows whose number modulo `every` is one of `rows`:
    /// they only test the result.
    #[must_use]
    pub fn measured_but(mut self, set: MeasurementSet, every: usize, rows: &[usize]) -> Self {
        let is_out = |row: &usize| every > 0 && rows.contains(&(row % every));
        let (out, used): (Vec<usize>, Vec<usize>) = (0..set.len()).partition(is_out);
        self.held_out.push((self.sets.len(), set.rows(&out)));
        self.measured(set.rows(&used))
    }

    /// The same, tested on these measurements, which are never used in the estimate.
    #[must_use]
    pub fn tested_on(mut self, set: MeasurementSet) -> Self {
        self.validate.push(set);
        self
    }

    /// The same, estimating these parameters, by names, patterns and words.
    #[must_use]
    pub fn estimating(mut self, parameters: &[&str]) -> Self {
        self.estimate.parameters = owned(parameters);
        self
    }

    /// The same, not estimating these parameters.
    #[must_use]
    pub fn fixing(mut self, parameters: &[&str]) -> Self {
        self.estimate.fixed.extend(owned(parameters));
        self
    }

    /// The same, with parameters held within a distance from nominal [m, rad or 1].
    #[must_use]
    pub fn bounded(mut self, parameters: &str, distance: f64) -> Self {
        let bound = (parameters.to_owned(), -distance, distance);
        self.estimate.bounds.push(bound);
        self
    }

    /// The same, with a prior about nominal: one standard deviation [m, rad or 1].
    #[must_use]
    pub fn prior(mut self, parameters: &str, sigma: f64) -> Self {
        self.estimate.priors.push((parameters.to_owned(), sigma));
        self
    }
}

fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}
