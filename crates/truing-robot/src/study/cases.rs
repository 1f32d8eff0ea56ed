//! A study, its cases and its ways to estimate.

use crate::estimate::{Estimate, Registration};
use crate::file::{ErrorSpec, SimulationSpec};
use crate::measurement;
use crate::robot::Arm;
use crate::text::{Source, Spanned};
use std::sync::Arc;

/// A study, ready to run.
pub struct Study {
    pub(super) source: Source,
    pub(super) seed: u64,
    pub(super) trials: usize,
    pub(super) configurations: usize,
    pub(super) arms: Vec<Arm>,
    pub(super) errors: ErrorSpec,
    pub(super) levels: Vec<Spanned<f64>>,
    pub(super) cases: Vec<Case>,
    pub(super) methods: Vec<Method>,
}

/// A part of a study: what is measured, and what is wrong.
pub(super) struct Case {
    pub name: String,
    pub constraints: Vec<SimulationSpec>,
    /// Which parameters of which robot have errors.
    pub chosen: Vec<Vec<bool>>,
    /// Whether only parameters have errors that are estimated, so that estimates can be compared
    /// with the truth one by one.
    pub comparable: bool,
    /// Whether true robots may be larger or smaller in a way that the measurements cannot see.
    pub scale_free: bool,
    /// Errors up to which a robot counts as recovered [m].
    pub tolerance: f64,
    /// The forms of the sets for every method; none where a method is not for this case.
    pub forms: Vec<Option<Forms>>,
}

/// The equations of every set of a case; none for a set with this crate's own.
pub(super) type Forms = Vec<Option<Arc<dyn measurement::Method>>>;

/// A way to estimate.
pub(super) struct Method {
    pub name: String,
    pub registration: Registration,
    /// Whether it starts at the true robots.
    pub from_truth: bool,
    pub estimate: Estimate,
}

impl Study {
    /// How many trials there are, over all cases and tool errors.
    pub fn trials(&self) -> usize {
        self.cases.len() * self.levels.len().max(1) * self.trials
    }

    /// The names of the cases.
    pub fn cases(&self) -> Vec<&str> {
        self.cases.iter().map(|case| case.name.as_str()).collect()
    }

    /// The names of the methods.
    pub fn methods(&self) -> Vec<&str> {
        self.methods
            .iter()
            .map(|method| method.name.as_str())
            .collect()
    }
}
