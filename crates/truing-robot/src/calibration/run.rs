//! Running a calibration: start, registration, estimate, covariance, validation.

use super::assembly::{Assembly, Owner, State};
use super::doubt::{DISTRUST, shortened};
use super::estimated::Registration;
use super::far::Strategy;
use super::measurement::{Arm, Measured, MeasurementSet};
use super::report::Report;
use super::result::{CalibrationResult, ErrorSeries, SetResult};
use super::select::{Choice, default_preference, in_order, select};
use super::start::{fit_eliminated, start};
use crate::constraint::Derivatives;
use crate::error::Error;
use crate::file::RobotFile;
use truing::{LeastSquares, Settings, Solution, Termination, Values, solve, solve_from};

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
        let uncertainty = match self.uncertainty(&fitted.estimated, &choices) {
            Ok(uncertainty) => Some(uncertainty),
            Err(error) => {
                warnings.push(format!(
                    "{DISTRUST}at this solution some unknowns cannot be told apart, so there are no standard deviations \
                     ({error})"
                ));
                None
            }
        };
        self.warn(&fitted, &constraints, &validation, &mut warnings);
        if let Some(uncertainty) = &uncertainty {
            let predictions = self.predictions(&fitted, &assembly, &choices, uncertainty);
            self.doubt_predictions(&predictions, &mut warnings);
            self.doubt_moves(&fitted.estimated, &assembly, uncertainty, &mut warnings);
        }
        self.doubt_limits(&fitted.estimated, &assembly, &choices, &mut warnings);
        if self.has_collapsed(&assembly, &choices, &solution.values) {
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
        if !still.is_empty() {
            warnings.push(format!(
                "not determined by these data, held at the start (`unexcited`): {}; measure in more varied postures",
                shortened(&still)
            ));
        }
        let report = Report {
            calibration: self,
            assembly: &assembly,
            choices: &choices,
            uncertainty: uncertainty.as_ref(),
        };
        let result = report.make(
            &fitted.estimated,
            &solution,
            constraints,
            validation,
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
            state: fitted.estimated,
            solution,
        })
    }

    /// Where the estimate starts. A base far from where its file puts it is where the registration
    /// found it. Otherwise the file knows better: a registration that the data hardly determine may wander.
    pub(super) fn near(&self, begin: &State, registered: &State) -> Result<State, Error> {
        let off = self.misfit(begin)?;
        let far = off > FAR && self.misfit(registered)? < 0.5 * off;
        Ok(if far { registered } else { begin }.clone())
    }

    /// The nominal robot with frames, base, tool points, planes and points estimated.
    ///
    /// Where a plane or point is out of reach of the robot as its file places it, positions and poses
    /// place it first.
    pub(super) fn register(
        &self,
        begin: &State,
        preference: &[(usize, usize)],
    ) -> Result<(State, Solution), Error> {
        let layout = Assembly::new(&self.arms, &self.sets, begin, &self.estimate.derivatives)?;
        let bases: Vec<Vec<usize>> = self
            .arms
            .iter()
            .map(|arm| arm.robot.base_parameters())
            .collect();
        let wanted = in_order(&layout, preference, |owner| match owner {
            Owner::Parameter { robot, parameter } => {
                bases[*robot].contains(parameter) && self.wants(*robot, *parameter)
            }
            _ => true,
        });
        let derivatives = &self.estimate.derivatives;
        let choices = match select(&self.arms, &self.sets, begin, derivatives, &wanted, &[]) {
            Err(Error::Unreachable { message, help }) => {
                let seen = |set: &&MeasurementSet| {
                    matches!(set.measured, Measured::Position(_) | Measured::Pose(_))
                };
                let sets: Vec<MeasurementSet> = self.sets.iter().filter(seen).cloned().collect();
                if sets.is_empty() || sets.len() == self.sets.len() {
                    return Err(Error::Unreachable { message, help });
                }
                let placing = Self {
                    sets,
                    ..self.clone()
                };
                let nominal = start(&self.arms, &placing.sets, self.nominal(), &State::default());
                let placed = placing.register(&nominal, preference)?.0.robots;
                let begin = start(&self.arms, &self.sets, placed, &State::default());
                let choices = select(&self.arms, &self.sets, &begin, derivatives, &wanted, &[])?;
                let (_, state, solution) = self.solve_columns(&begin, &choices, false)?;
                return Ok((state, solution));
            }
            choices => choices?,
        };
        let (_, state, solution) = self.solve_columns(begin, &choices, false)?;
        Ok((state, solution))
    }

    /// Where the estimate starts: near a state, inside the bounds, with what is not estimated at
    /// nominal.
    fn starting_state(&self, near: &State, choices: &[Choice], layout: &Assembly) -> State {
        let mut robots = self.nominal();
        for (c, column) in layout.columns.iter().enumerate() {
            if let (Choice::Estimated, Owner::Parameter { robot, parameter }) =
                (&choices[c], &column.owner)
            {
                robots[*robot][*parameter] = near.robots[*robot][*parameter];
            }
        }
        for (robot, parameter, lower, upper) in &self.estimate.bounds {
            let nominal = self.arms[*robot].robot.parameters()[*parameter].nominal;
            let value = &mut robots[*robot][*parameter];
            *value = value.max(nominal + lower).min(nominal + upper);
        }
        if robots == near.robots {
            return near.clone();
        }
        start(&self.arms, &self.sets, robots, &State::default())
    }

    /// Where a bounded parameter ended, if it is at one of its bounds.
    pub(super) fn at_bound(
        &self,
        robot: usize,
        parameter: usize,
        estimate: f64,
    ) -> Option<&'static str> {
        let bound = |(r, p, ..): &&(usize, usize, f64, f64)| (*r, *p) == (robot, parameter);
        let (_, _, lower, upper) = self.estimate.bounds.iter().find(bound)?;
        let moved = estimate - self.arms[robot].robot.parameters()[parameter].nominal;
        let close = 1e-9 * (upper - lower);
        if moved <= lower + close {
            Some("lower")
        } else if moved >= upper - close {
            Some("upper")
        } else {
            None
        }
    }

    /// The estimate: from a state, or from where a search finds that it should start.
    fn estimate_columns(
        &self,
        from: &State,
        choices: &[Choice],
        warnings: &mut Vec<String>,
    ) -> Result<(Assembly, State, Solution), Error> {
        let assembly = self.columns_assembled(from, choices, true)?;
        let Some(found) = self.far_start(from, &assembly, choices)? else {
            return self.solve_assembled(assembly, true);
        };
        let initial = assembly.problem.initial();
        let mut solution = solve_from(&assembly.problem, &found.values, &self.estimate.settings)?;
        let mut r = vec![0.0; assembly.problem.rows()];
        solution.initial_cost = assembly.problem.residual(initial, &mut r);
        solution.iterations += found.iterations;
        solution.evaluations.residual += found.evaluations.residual;
        solution.evaluations.jacobian += found.evaluations.jacobian;
        if found.starts > 0 {
            warnings.push(format!(
                "the nominal robot is far from what was measured: a few plain steps did not fit it, {} did{}",
                match found.starts {
                    1 => "a continuation".to_owned(),
                    n => format!("the best of {n} continuations from places near it"),
                },
                if found.sure {
                    String::new()
                } else {
                    format!(
                        ", whose weighted residuals are {:.1} RMS: no start led to one that is down to the noise",
                        found.rms
                    )
                }
            ));
        }
        if !found.sure {
            warnings.push(format!(
                "{DISTRUST}no start led to a fit that is down to the noise, nor did two lead to the same one; the robot file, \
                 the measurements or their `sigma` may be wrong"
            ));
        }
        let mut state = assembly.state(&solution.values);
        fit_eliminated(&self.arms, &self.sets, &mut state);
        Ok((assembly, state, solution))
    }

    /// Estimates the chosen columns from a state. The registration takes no bounds and priors.
    fn solve_columns(
        &self,
        from: &State,
        choices: &[Choice],
        full: bool,
    ) -> Result<(Assembly, State, Solution), Error> {
        let assembly = self.columns_assembled(from, choices, full)?;
        self.solve_assembled(assembly, full)
    }

    /// The problem at a state with the chosen columns free.
    fn columns_assembled(
        &self,
        from: &State,
        choices: &[Choice],
        full: bool,
    ) -> Result<Assembly, Error> {
        let mut assembly = Assembly::new(&self.arms, &self.sets, from, &self.estimate.derivatives)?;
        let free: Vec<usize> = (0..choices.len())
            .filter(|c| choices[*c] == Choice::Estimated)
            .collect();
        assembly.free_only(&free);
        if full {
            for (robot, parameter, lower, upper) in &self.estimate.bounds {
                let var = assembly.robot(*robot);
                // The problem's bounds are about its start, which is inside but for rounding.
                let nominal = self.arms[*robot].robot.parameters()[*parameter].nominal;
                let shift = nominal - from.robots[*robot][*parameter];
                let (lower, upper) = ((lower + shift).min(0.0), (upper + shift).max(0.0));
                assembly
                    .problem
                    .bound_component(var, *parameter, lower, upper);
            }
            for (robot, parameter, sigma) in &self.estimate.priors {
                let var = assembly.robot(*robot);
                if choices[var.column() + parameter] == Choice::Estimated {
                    let nominal = self.arms[*robot].robot.nominal();
                    assembly
                        .problem
                        .prior_components(var, &nominal, &[(*parameter, *sigma)])?;
                }
            }
        }
        Ok(assembly)
    }

    fn solve_assembled(
        &self,
        assembly: Assembly,
        full: bool,
    ) -> Result<(Assembly, State, Solution), Error> {
        if assembly.problem.free().is_empty() {
            if full {
                return Err(Error::calibration(
                    "nothing is left to estimate",
                    "free some parameters (`parameters`, `fixed`) or add measurements that depend on them",
                ));
            }
            let values = assembly.problem.initial().clone();
            let mut state = assembly.state(&values);
            fit_eliminated(&self.arms, &self.sets, &mut state);
            return Ok((assembly, state, unchanged(values)));
        }
        let solution = if full {
            solve(&assembly.problem, &self.estimate.settings)?
        } else {
            let settings = Settings {
                interrupt: self.estimate.settings.interrupt.clone(),
                ..Settings::default()
            };
            solve(&assembly.problem, &settings)?
        };
        let mut state = assembly.state(&solution.values);
        fit_eliminated(&self.arms, &self.sets, &mut state);
        Ok((assembly, state, solution))
    }
}

/// Errors [m] above which the robot does not stand where its file says.
const FAR: f64 = 0.05;

/// The solution of a problem in which nothing is free.
fn unchanged(values: Values) -> Solution {
    Solution {
        values,
        termination: Termination::Gradient {
            value: 0.0,
            tolerance: 0.0,
        },
        cost: 0.0,
        initial_cost: 0.0,
        iterations: 0,
        evaluations: truing::solver::Evaluations::default(),
        blocks: Vec::new(),
    }
}
