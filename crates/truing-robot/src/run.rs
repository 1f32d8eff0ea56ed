//! The pipeline of a calibration, from what was measured to the result.

use crate::doubt::Doubt;
use crate::error::Error;
use crate::estimate::{Calibration, Job, Registration, Stage};
use crate::judge::doubt::doubt_choices;
use crate::judge::{ErrorSeries, Fitted, MeasurementStatistics, SetResult, Uncertainty};
use crate::measurement::MeasurementSet;
use crate::result::{CalibrationResult, Report};
use crate::robot::RobotFile;
use crate::unknown::State;
use truing::Solution;

/// The outcome of a calibration.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The report.
    pub result: CalibrationResult,
    /// The calibrated robots, ready to be written.
    pub robots: Vec<(String, RobotFile)>,
    /// Errors of every measurement, set after set, then of the rows held out.
    pub errors: Vec<ErrorSeries>,
    /// What is said of every measurement that was used, set after set.
    pub measurements: Vec<MeasurementStatistics>,
    /// How sure the estimate is, and what can be predicted from it; none where unknowns cannot be told
    /// apart.
    pub uncertainty: Option<Uncertainty>,
    /// The estimated state.
    pub state: State,
    /// The solution of the least-squares problem.
    pub solution: Solution,
}

impl Calibration {
    /// Runs the calibration; `watch` is told of every stage.
    ///
    /// # Errors
    /// If names or measurements do not fit, if there is too little to estimate from, or no usable starting
    /// point. Not converging is not an error: the result says so.
    pub fn run(&self, watch: &dyn Fn(Stage)) -> Result<Outcome, Error> {
        let (job, skipped) = Job::of(self)?.without_small_groups()?;
        let notes = job.notes.iter().cloned().chain(skipped);
        let doubts = notes.map(Doubt::note).collect();
        job.run(doubts, watch)
    }

    /// Runs the calibration.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn calibrate(&self) -> Result<Outcome, Error> {
        self.run(&|_| ())
    }
}

impl Job {
    fn run(&self, mut doubts: Vec<Doubt>, watch: &dyn Fn(Stage)) -> Result<Outcome, Error> {
        let solved = self.solve_checked(Registration::Always, &mut doubts, watch)?;
        let (assembly, choices, solution) = (solved.assembly, solved.choices, solved.solution);
        let (held, drawing) = (solved.held, solved.part);

        watch(Stage::Validating);
        let fitted = Fitted {
            nominal: solved.begin,
            registered: solved.registered,
            estimated: solved.estimated,
        };
        let held_out = || self.held_out.iter().map(|(_, set)| set);
        let summarise = |set: &MeasurementSet| self.summarise(set, &fitted);
        let constraints: Vec<SetResult> =
            self.sets.iter().map(summarise).collect::<Result<_, _>>()?;
        let mut validation: Vec<SetResult> = held_out().map(summarise).collect::<Result<_, _>>()?;
        let mut errors = Vec::new();
        for set in &self.sets {
            errors.push(self.series(set, &fitted, false)?);
        }
        for set in held_out() {
            errors.push(self.series(set, &fitted, true)?);
        }
        for set in &self.validate {
            validation.push(self.validate_set(set, &fitted)?);
        }
        let judged = match self.uncertainty(&fitted.estimated, &choices, &held) {
            Ok(judged) => Some(judged),
            Err(error) => {
                doubts.push(Doubt::Inseparable {
                    reason: error.to_string(),
                });
                None
            }
        };
        self.warn(&fitted, &constraints, &validation, &mut doubts);
        self.doubt_models(&fitted, &assembly, &choices, &mut doubts)?;
        let statistics = judged
            .as_ref()
            .map(|judged| self.statistics(judged, &choices, &errors));
        let mut everywhere = Vec::new();
        self.doubt_inputs(&fitted.registered, &mut doubts)?;
        if let Some(judged) = &judged {
            self.doubt_misfit(judged, &mut doubts);
            everywhere = self.doubt_forecast(&fitted, &assembly, &choices, judged, &mut doubts)?;
        }
        let uncertainty = judged.map(|judged| judged.uncertainty);
        if let Some(uncertainty) = &uncertainty {
            self.doubt_moves(&fitted.estimated, &assembly, uncertainty, &mut doubts);
        }
        self.doubt_limits(
            &fitted.estimated,
            &solution,
            &assembly,
            &choices,
            &mut doubts,
        );
        if self.has_collapsed(&fitted.nominal, &fitted.estimated)? {
            doubts.push(Doubt::Collapsed);
        }
        doubt_choices(&assembly, &choices, &mut doubts);
        let noise = uncertainty.as_ref().map_or(f64::NAN, |u| u.factor());
        let outliers = self.outliers(&solution, &fitted.estimated, statistics.as_ref(), noise)?;
        self.doubt_outliers(&outliers, &mut doubts);
        let report = Report {
            job: self,
            assembly: &assembly,
            choices: &choices,
            uncertainty: uncertainty.as_ref(),
            statistics: statistics.as_ref(),
            drawing,
        };
        let result = report.make(
            &fitted.estimated,
            &solution,
            constraints,
            validation,
            outliers,
            doubts,
            everywhere,
        )?;
        let robots = self
            .arms
            .iter()
            .zip(&fitted.estimated.robots)
            .map(|(arm, values)| (arm.name.clone(), arm.robot.with_parameters(values)))
            .collect();
        Ok(Outcome {
            result,
            robots,
            errors,
            measurements: statistics.map(|s| s.measurements).unwrap_or_default(),
            uncertainty,
            state: fitted.estimated,
            solution,
        })
    }
}
