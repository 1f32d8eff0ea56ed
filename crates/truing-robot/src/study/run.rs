//! Running a study: trials in parallel, put together in order.

use super::cases::Study;
use super::draw::{self, Purpose, Stream};
use super::judge::judge;
use super::level::{Scaled, scale};
use super::summary::{Outcome, StudyResult, Trial};
use crate::error::Error;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

impl Study {
    /// Runs all trials on so many threads (all processors by default). Set `interrupt` to stop after
    /// the trials under way; `tick` is called after every trial.
    ///
    /// The result does not depend on the number of threads.
    ///
    /// # Errors
    /// If the errors cannot be scaled to a tool error, or threads cannot be started.
    pub fn run(
        &self,
        threads: Option<usize>,
        interrupt: &AtomicBool,
        tick: &(dyn Fn() + Sync),
    ) -> Result<StudyResult, Error> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.unwrap_or(0))
            .build()
            .map_err(|error| {
                let help = "ask for fewer with --threads";
                Error::calibration(format!("cannot start threads: {error}"), help)
            })?;
        pool.install(|| self.run_here(interrupt, tick))
    }

    fn run_here(
        &self,
        interrupt: &AtomicBool,
        tick: &(dyn Fn() + Sync),
    ) -> Result<StudyResult, Error> {
        let levels = self.levels.len().max(1);
        let scaled: Vec<Scaled> = (0..self.cases.len() * levels)
            .into_par_iter()
            .map(|k| {
                scale(
                    self,
                    &self.cases[k / levels],
                    k % levels,
                    self.levels.get(k % levels),
                )
            })
            .collect::<Result<_, _>>()?;
        let trials: Vec<Option<Trial>> = (0..self.trials())
            .into_par_iter()
            .map(|k| {
                if interrupt.load(Ordering::SeqCst) {
                    return Ok(None);
                }
                let (part, trial) = (k / self.trials, k % self.trials);
                let made = self.trial(part / levels, part % levels, trial, scaled[part].factor)?;
                tick();
                Ok(Some(made))
            })
            .collect::<Result<_, Error>>()?;
        Ok(StudyResult::of(self, &scaled, &trials))
    }

    fn trial(&self, case: usize, level: usize, trial: usize, factor: f64) -> Result<Trial, Error> {
        let case = &self.cases[case];
        let stream = Stream {
            seed: self.seed,
            level,
            trial,
        };
        let errors = draw::errors(self, case, stream);
        let robots = draw::robots(self, &errors, factor);
        let (drawn, redrawn) =
            draw::measurements(self, case, &robots, stream, Purpose::Measurements)?;
        let Some(drawn) = drawn else {
            return Ok(Trial {
                redrawn,
                outcomes: None,
            });
        };
        let postures = draw::postures(self, stream);
        let mut outcomes = Vec::new();
        for (m, method) in self.methods.iter().enumerate() {
            outcomes.push(match self.estimate(case, m, &drawn, method.registration) {
                None => None,
                // No usable starting point, say: the robot is not recovered.
                Some(Err(_)) => Some(Outcome::refused()),
                Some(Ok(estimated)) => {
                    let judged = judge(self, case, &drawn, &postures, &estimated)?;
                    let solution = &estimated.solution;
                    Some(Outcome {
                        recovered: judged.fresh <= case.tolerance && judged.tool <= case.tolerance,
                        ended: solution.termination.kind(),
                        iterations: solution.iterations,
                        residual_evaluations: solution.evaluations.residual,
                        jacobian_evaluations: solution.evaluations.jacobian,
                        fresh: judged.fresh,
                        tool: judged.tool,
                        parameters: judged.parameters,
                    })
                }
            });
        }
        Ok(Trial {
            redrawn,
            outcomes: Some(outcomes),
        })
    }
}
