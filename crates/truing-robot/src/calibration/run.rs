//! Running a calibration: start, registration, estimate, covariance, validation.

use super::assembly::Assembly;
use super::doubt::{DISTRUST, shortened};
use super::estimated::Registration;
use super::far::Strategy;
use super::measurement::{Arm, MeasurementSet};
use super::report::Report;
use super::result::{CalibrationResult, ErrorSeries, MeasurementStatistics, SetResult};
use super::select::{Choice, default_preference, in_order, select};
use super::solve::FAR;
use super::start::start;
use super::state::{Owner, State};
use super::uncertainty::Uncertainty;
use crate::constraint::Derivatives;
use crate::error::Error;
use crate::file::RobotFile;
use truing::{Settings, Solution};

/// What to estimate, and how.
#[derive(Clone, Default)]
pub struct Estimate {
    /// Which parameters of which robot, as `wanted[robot][parameter]`: everything of a robot that has
    /// no list, nothing beyond the end of one.
    pub wanted: Vec<Vec<bool>>,
    /// Bounds on the difference from nominal, as (robot, parameter, lower, upper) [m, rad or 1].
    pub bounds: Vec<(usize, usize, f64, f64)>,
    /// Priors about nominal, as (robot, parameter, standard deviation).
    pub priors: Vec<(usize, usize, f64)>,
    /// Parameters in order of preference, as (robot, parameter); those left out follow in the default order.
    pub preference: Vec<(usize, usize)>,
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

/// What a run is doing, for those who watch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Deciding what can be estimated.
    Identifying,
    /// Estimating frames, tool points, planes and points with the nominal robot.
    Registering,
    /// Estimating the robot.
    Estimating,
    /// Predicting rows that were not used.
    Validating,
}

impl Stage {
    /// In words.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Identifying => "deciding what can be estimated",
            Self::Registering => "registering the nominal robot",
            Self::Estimating => "estimating",
            Self::Validating => "validating",
        }
    }
}

/// A calibration problem: robots, what was measured, what to estimate.
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

/// What the estimate leaves for the reports.
pub(super) struct Solved {
    pub begin: State,
    pub registered: State,
    pub estimated: State,
    pub assembly: Assembly,
    pub choices: Vec<Choice>,
    pub solution: Solution,
}

/// A set's residuals are summarised from these three states.
pub(super) struct Fitted {
    pub nominal: State,
    pub registered: State,
    pub estimated: State,
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

    pub(super) fn wants(&self, robot: usize, parameter: usize) -> bool {
        self.estimate
            .wanted
            .get(robot)
            .is_none_or(|wanted| wanted.get(parameter) == Some(&true))
    }

    pub(super) fn preference(&self) -> Vec<(usize, usize)> {
        let mut order = self.estimate.preference.clone();
        for parameter in default_preference(&self.arms) {
            if !order.contains(&parameter) {
                order.push(parameter);
            }
        }
        order
    }

    pub(super) fn nominal(&self) -> Vec<Vec<f64>> {
        self.arms.iter().map(|arm| arm.robot.nominal()).collect()
    }

    /// Runs the calibration; `watch` is told of every stage.
    ///
    /// # Errors
    /// If there is nothing to estimate from, or too little, or no usable starting point. Not
    /// converging is not an error: the result says so.
    pub fn run(&self, watch: &dyn Fn(Stage)) -> Result<Outcome, Error> {
        let mut warnings = self.notes.clone();
        let (calibration, skipped) = self.without_small_groups()?;
        warnings.extend(skipped);
        calibration.run_checked(warnings, watch)
    }

    /// Start, registration, selection, estimate.
    pub(super) fn solve_checked(
        &self,
        registration: Registration,
        warnings: &mut Vec<String>,
        watch: &dyn Fn(Stage),
    ) -> Result<Solved, Error> {
        let derivatives = &self.estimate.derivatives;
        let begin = start(&self.arms, &self.sets, self.nominal(), &State::default());
        let preference = self.preference();

        watch(Stage::Registering);
        let layout = Assembly::new(&self.arms, &self.sets, &begin, derivatives)?;
        let off = self.misfit(&begin)?;
        let mut registered = begin.clone();
        if registration == Registration::Always
            || (registration == Registration::IfFar && off > FAR)
        {
            let solution;
            (registered, solution) = self.register(&begin, &preference)?;
            if !solution.termination.converged() {
                warnings.push(format!(
                    "the registration of the nominal robot, with which it is compared, did not converge: {}",
                    solution.termination
                ));
            }
        }

        let near = self.near(&begin, &registered)?;

        watch(Stage::Identifying);
        let wanted = in_order(&layout, &preference, |owner| match owner {
            Owner::Parameter { robot, parameter } => self.wants(*robot, *parameter),
            _ => true,
        });
        let priors: Vec<usize> = self
            .estimate
            .priors
            .iter()
            .map(|(robot, parameter, _)| layout.robot(*robot).column() + parameter)
            .collect();
        let choices = select(&self.arms, &self.sets, &near, derivatives, &wanted, &priors)?;
        let rows = layout.problem.rows();
        // What the structure allows: with too few rows, which of it these data excite is chance.
        let unknowns = choices
            .iter()
            .filter(|c| matches!(c, Choice::Estimated | Choice::Unexcited))
            .count();
        // A prior counts for a parameter that is estimated, or would be without it.
        let counts = |c: &&usize| matches!(choices[**c], Choice::Estimated | Choice::Unexcited);
        let idle: Vec<String> = priors
            .iter()
            .filter(|c| !counts(c))
            .map(|c| layout.columns[*c].name.clone())
            .collect();
        let priors = priors.iter().filter(counts).count();
        if !idle.is_empty() && priors == 0 {
            warnings.push(format!(
                "no prior has an effect: {} are not estimated",
                shortened(&idle)
            ));
        }
        if rows + priors < unknowns {
            return Err(Error::calibration(
                format!(
                    "found {rows} measured values for {unknowns} unknowns (parameters, frames, tool points, planes and \
                     points together); expected at least as many values"
                ),
                "measure more configurations, or estimate fewer parameters (`parameters`, `fixed`)",
            ));
        }
        if rows + priors == unknowns {
            warnings.push(format!(
                "there are as many unknowns as measured values, {rows}: they fit whatever was measured, and nothing checks them"
            ));
        }

        watch(Stage::Estimating);
        let near = match &self.estimate.from {
            Some(robots) => start(&self.arms, &self.sets, robots.clone(), &State::default()),
            None => near,
        };
        let from = self.starting_state(&near, &choices, &layout);
        let (assembly, estimated, solution) = self.estimate_columns(&from, &choices, warnings)?;
        Ok(Solved {
            begin,
            registered,
            estimated,
            assembly,
            choices,
            solution,
        })
    }

    fn run_checked(
        &self,
        mut warnings: Vec<String>,
        watch: &dyn Fn(Stage),
    ) -> Result<Outcome, Error> {
        let solved = self.solve_checked(Registration::Always, &mut warnings, watch)?;
        let (assembly, choices, solution) = (solved.assembly, solved.choices, solved.solution);

        watch(Stage::Validating);
        let fitted = Fitted {
            nominal: solved.begin,
            registered: solved.registered,
            estimated: solved.estimated,
        };
        let constraints: Vec<SetResult> = (0..self.sets.len())
            .map(|k| self.summarise(k, &self.sets[k], &fitted))
            .collect::<Result<_, _>>()?;
        let mut validation: Vec<SetResult> = self
            .held_out
            .iter()
            .map(|(k, set)| self.summarise(*k, set, &fitted))
            .collect::<Result<_, _>>()?;
        let mut errors = Vec::new();
        for (k, set) in self.sets.iter().enumerate() {
            errors.push(self.series(k, set, &fitted, false)?);
        }
        for (k, set) in &self.held_out {
            errors.push(self.series(*k, set, &fitted, true)?);
        }
        for set in &self.validate {
            validation.push(self.validate_set(set, &fitted)?);
        }
        let judged = match self.uncertainty(&fitted.estimated, &choices) {
            Ok(judged) => Some(judged),
            Err(error) => {
                warnings.push(format!(
                    "{DISTRUST}at this solution some unknowns cannot be told apart, so there are no standard deviations \
                     ({error})"
                ));
                None
            }
        };
        self.warn(&fitted, &constraints, &validation, &mut warnings);
        let statistics = judged
            .as_ref()
            .map(|judged| self.statistics(judged, &choices, &errors));
        let uncertainty = judged.map(|judged| judged.uncertainty);
        if let Some(uncertainty) = &uncertainty {
            let predictions = self.predictions(&fitted, &assembly, &choices, uncertainty);
            self.doubt_predictions(&predictions, &mut warnings);
            self.doubt_moves(&fitted.estimated, &assembly, uncertainty, &mut warnings);
        }
        self.doubt_limits(
            &fitted.estimated,
            &solution,
            &assembly,
            &choices,
            &mut warnings,
        );
        if self.has_collapsed(&fitted.nominal, &fitted.estimated)? {
            warnings.push(format!(
                "{DISTRUST}the estimated robot fits because its joints hardly matter any more: it has collapsed, or its axes \
                 have turned parallel; add a `prior` about nominal, or measurements that hold its size"
            ));
        }
        let anchors: Vec<&str> = (0..choices.len())
            .filter(|c| matches!(choices[*c], Choice::Anchor(_)))
            .map(|c| assembly.columns[c].name.as_str())
            .collect();
        if !anchors.is_empty() {
            warnings.push(format!(
                "these data leave the scale free: a robot with all lengths longer fits as well; held by {} at nominal \
                 (a tracker position or a known distance would determine it)",
                anchors.join(", ")
            ));
        }
        let still: Vec<String> = (0..choices.len())
            .filter(|c| choices[*c] == Choice::Unexcited)
            .map(|c| assembly.columns[c].name.clone())
            .collect();
        for (c, column) in assembly.columns.iter().enumerate() {
            if let (Choice::Unexcited, Owner::Frame(name)) = (&choices[c], &column.owner) {
                warnings.push(format!(
                    "{DISTRUST}the sensor frame `{name}` is not determined by its readings ({}): read at least three \
                     places that are not in one line",
                    column.name
                ));
            }
        }
        let wanted = |c: &usize| matches!(assembly.columns[*c].owner, Owner::Parameter { .. });
        let robots: Vec<&Choice> = (0..choices.len())
            .filter(wanted)
            .map(|c| &choices[c])
            .collect();
        if !robots.contains(&&Choice::Estimated) && robots.contains(&&Choice::Unexcited) {
            warnings.push(format!(
                "{DISTRUST}these data determine none of the robot parameters that were asked for: measure in more varied postures"
            ));
        }
        if !still.is_empty() {
            warnings.push(format!(
                "not determined by these data, held at the start (`unexcited`): {}; measure in more varied postures",
                shortened(&still)
            ));
        }
        let noise = uncertainty.as_ref().map_or(f64::NAN, |u| u.factor());
        let outliers = self.outliers(&solution, &fitted.estimated, statistics.as_ref(), noise)?;
        self.doubt_outliers(&outliers, &mut warnings);
        let report = Report {
            calibration: self,
            assembly: &assembly,
            choices: &choices,
            uncertainty: uncertainty.as_ref(),
            statistics: statistics.as_ref(),
        };
        let result = report.make(
            &fitted.estimated,
            &solution,
            constraints,
            validation,
            outliers,
            warnings,
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
