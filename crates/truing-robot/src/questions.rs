//! What the measurements of a calibration identify.

use crate::error::Error;
use crate::estimate::{Calibration, Job};
use crate::identify::{Identification, Question, SEED};
use crate::start::start;
use crate::unknown::State;

impl Calibration {
    /// What its measurements identify, by structure and by the data.
    ///
    /// # Errors
    /// If a plane, point or distance is out of reach.
    pub fn identify(&self, seed: Option<u64>) -> Result<Identification, Error> {
        self.question(seed)?.answer()
    }

    /// The question what its measurements identify; random configurations by `seed`, or the usual one.
    ///
    /// # Errors
    /// If a plane, point or distance is out of reach.
    pub fn question(&self, seed: Option<u64>) -> Result<Question, Error> {
        let (job, skipped) = Job::of(self)?.without_small_groups()?;
        let mut warnings = job.notes.clone();
        warnings.extend(skipped);
        let begin = start(&job.arms, &job.sets, job.nominal(), &State::default());
        let (registered, _) = job.register(&begin)?;
        let state = job.near(&begin, &registered)?;
        let priors = job.estimate.priors.iter();
        Ok(Question {
            with_prior: priors.map(|(r, p, _)| (*r, *p)).collect(),
            wanted: job.estimate.wanted,
            preference: job.estimate.preference,
            derivatives: job.estimate.derivatives,
            seed: seed.unwrap_or(SEED),
            arms: job.arms,
            sets: job.sets,
            state,
            warnings,
        })
    }
}
