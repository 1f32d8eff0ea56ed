//! Running a calibration: start, registration, estimate, covariance, validation.

use super::assembly::{Assembly, Owner, State};
use super::measurement::{Arm, Measured, MeasurementSet};
use super::result::{
    CalibrationResult, ErrorSummary, FrameEstimate, ParameterResult, PlaneEstimate, PointEstimate,
    SetResult, Status, TargetEstimate, TerminationReport,
};
use super::select::{Choice, default_preference, in_order, select};
use super::start::start;
use crate::constraint::Derivatives;
use crate::error::Error;
use crate::file::{InputError, RobotFile};
use crate::kinematics::Unit;
use truing::{Covariance, Settings, Solution, Termination, Values, solve};

/// What to estimate, and how.
#[derive(Clone, Default)]
pub struct Estimate {
    /// Which parameters of which robot, as `wanted[robot][parameter]`; everything where empty.
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
    /// The estimated state.
    pub state: State,
    /// The solution of the least-squares problem.
    pub solution: Solution,
}

/// A set's residuals are summarised from these three states.
struct Fitted {
    nominal: State,
    registered: State,
    estimated: State,
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

    fn wants(&self, robot: usize, parameter: usize) -> bool {
        self.estimate
            .wanted
            .get(robot)
            .is_none_or(|wanted| wanted[parameter])
    }

    fn preference(&self) -> Vec<(usize, usize)> {
        let mut order = self.estimate.preference.clone();
        for parameter in default_preference(&self.arms) {
            if !order.contains(&parameter) {
                order.push(parameter);
            }
        }
        order
    }

    fn nominal(&self) -> Vec<Vec<f64>> {
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

    /// Leaves out planes with fewer than four touches and points visited once: any robot fits them.
    fn without_small_groups(&self) -> Result<(Self, Vec<String>), Error> {
        let mut warnings = Vec::new();
        let mut calibration = self.clone();
        for (k, set) in calibration.sets.iter_mut().enumerate() {
            let Some((small, warning)) = small_groups(set)? else {
                continue;
            };
            warnings.push(warning);
            *set = keep_groups(set, &small);
            for (of, held) in &mut calibration.held_out {
                if *of == k {
                    *held = keep_groups(held, &small);
                }
            }
        }
        for set in &mut calibration.validate {
            if let Some((small, warning)) = small_groups(set)? {
                warnings.push(warning);
                *set = keep_groups(set, &small);
            }
        }
        calibration.held_out.retain(|(_, set)| !set.is_empty());
        Ok((calibration, warnings))
    }

    fn run_checked(
        &self,
        mut warnings: Vec<String>,
        watch: &dyn Fn(Stage),
    ) -> Result<Outcome, Error> {
        let derivatives = &self.estimate.derivatives;
        let begin = start(&self.arms, &self.sets, self.nominal(), &State::default());
        let preference = self.preference();

        watch(Stage::Registering);
        let layout = Assembly::new(&self.arms, &self.sets, &begin, derivatives)?;
        let bases: Vec<Vec<usize>> = self
            .arms
            .iter()
            .map(|arm| arm.robot.base_parameters())
            .collect();
        let wanted = in_order(&layout, &preference, |owner| match owner {
            Owner::Parameter { robot, parameter } => {
                bases[*robot].contains(parameter) && self.wants(*robot, *parameter)
            }
            _ => true,
        });
        let choices = select(&self.arms, &self.sets, &begin, derivatives, &wanted, &[])?;
        let registered = self.solve_columns(&begin, &choices, false)?.1;

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
        let choices = select(
            &self.arms,
            &self.sets,
            &begin,
            derivatives,
            &wanted,
            &priors,
        )?;
        let rows: usize = self.sets.iter().map(|set| set.len() * set.dim()).sum();
        // What the structure allows: with too few rows, which of it these data excite is chance.
        let unknowns = choices
            .iter()
            .filter(|c| matches!(c, Choice::Estimated | Choice::Unexcited))
            .count();
        let priors = self.estimate.priors.len();
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
        let (assembly, estimated, solution) = {
            let (assembly, state, solution) = self.solve_columns(&begin, &choices, true)?;
            (assembly, state, solution)
        };

        watch(Stage::Validating);
        let fitted = Fitted {
            nominal: begin,
            registered,
            estimated,
        };
        let constraints: Vec<SetResult> = (0..self.sets.len())
            .map(|k| self.summarise(k, &self.sets[k], &fitted))
            .collect::<Result<_, _>>()?;
        let mut validation: Vec<SetResult> = self
            .held_out
            .iter()
            .map(|(k, set)| self.summarise(*k, set, &fitted))
            .collect::<Result<_, _>>()?;
        for set in &self.validate {
            validation.push(self.validate_set(set, &fitted)?);
        }
        let covariance = match Covariance::at(&assembly.problem, &solution.values) {
            Ok(covariance) => Some(covariance),
            Err(error) => {
                warnings.push(format!(
                    "{DISTRUST}at this solution some unknowns cannot be told apart, so there are no standard deviations \
                     ({error})"
                ));
                None
            }
        };
        self.warn(&fitted, &constraints, &validation, &mut warnings);
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
            covariance: covariance.as_ref(),
        };
        let result = report.make(
            &fitted.estimated,
            &solution,
            constraints,
            validation,
            warnings,
        );
        let robots = self
            .arms
            .iter()
            .zip(&fitted.estimated.robots)
            .map(|(arm, values)| (arm.name.clone(), arm.robot.with_parameters(values)))
            .collect();
        Ok(Outcome {
            result,
            robots,
            state: fitted.estimated,
            solution,
        })
    }

    /// Estimates the chosen columns from a state. The registration takes no bounds and priors.
    fn solve_columns(
        &self,
        from: &State,
        choices: &[Choice],
        full: bool,
    ) -> Result<(Assembly, State, Solution), Error> {
        let mut assembly = Assembly::new(&self.arms, &self.sets, from, &self.estimate.derivatives)?;
        let free: Vec<usize> = (0..choices.len())
            .filter(|c| choices[*c] == Choice::Estimated)
            .collect();
        assembly.free_only(&free);
        if full {
            for (robot, parameter, lower, upper) in &self.estimate.bounds {
                let var = assembly.robot(*robot);
                assembly
                    .problem
                    .bound_component(var, *parameter, *lower, *upper);
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
        if free.is_empty() {
            if full {
                return Err(Error::calibration(
                    "nothing is left to estimate",
                    "free some parameters (`parameters`, `fixed`) or add measurements that depend on them",
                ));
            }
            let values = assembly.problem.initial().clone();
            let state = assembly.state(&values);
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
        let state = assembly.state(&solution.values);
        Ok((assembly, state, solution))
    }

    /// Errors of rows of set `k` (the set itself, or rows held out of it) in the three states.
    fn summarise(
        &self,
        k: usize,
        set: &MeasurementSet,
        fitted: &Fitted,
    ) -> Result<SetResult, Error> {
        let errors = |state: &State| -> Result<ErrorSummary, Error> {
            let own = State {
                planes: vec![state.planes[k].clone()],
                points: vec![state.points[k].clone()],
                distances: vec![state.distances[k]],
                ..state.clone()
            };
            self.errors(set, &own)
        };
        Ok(SetResult {
            name: set.name.clone(),
            kind: set.measured.kind().to_owned(),
            count: set.len(),
            rows: set.len() * set.dim(),
            before: if given(set) {
                Some(errors(&fitted.nominal)?)
            } else {
                None
            },
            registered: Some(errors(&fitted.registered)?),
            after: Some(errors(&fitted.estimated)?),
            unit: "m",
        })
    }

    /// Errors of one set in a state whose planes, points and distances are this set's.
    fn errors(&self, set: &MeasurementSet, state: &State) -> Result<ErrorSummary, Error> {
        let assembly = Assembly::new(
            &self.arms,
            std::slice::from_ref(set),
            state,
            &self.estimate.derivatives,
        )?;
        let residuals = assembly.residuals(0, assembly.problem.initial());
        Ok(ErrorSummary::of_residuals(&residuals, set.dim()))
    }

    /// Errors of a set that only validates: what it alone knows of is fitted to it, robots stay.
    fn validate_set(&self, set: &MeasurementSet, fitted: &Fitted) -> Result<SetResult, Error> {
        let sets = std::slice::from_ref(set);
        let errors = |state: &State| -> Result<ErrorSummary, Error> {
            let begin = start(&self.arms, sets, state.robots.clone(), state);
            let mut assembly = Assembly::new(&self.arms, sets, &begin, &self.estimate.derivatives)?;
            let free: Vec<usize> = in_order(&assembly, &[], |owner| match owner {
                Owner::Parameter { .. } | Owner::Constant => false,
                Owner::Frame(name) => !state.frames.contains_key(name),
                Owner::Target(robot, name) => !state.targets.contains_key(&(*robot, name.clone())),
                _ => true,
            });
            assembly.free_only(&free);
            let values: Values = if free.is_empty() {
                assembly.problem.initial().clone()
            } else {
                solve(&assembly.problem, &Settings::default())?.values
            };
            Ok(ErrorSummary::of_residuals(
                &assembly.residuals(0, &values),
                set.dim(),
            ))
        };
        let before = if given(set) {
            Some(self.errors(
                set,
                &start(
                    &self.arms,
                    sets,
                    fitted.nominal.robots.clone(),
                    &State::default(),
                ),
            )?)
        } else {
            None
        };
        Ok(SetResult {
            name: set.name.clone(),
            kind: set.measured.kind().to_owned(),
            count: set.len(),
            rows: set.len() * set.dim(),
            before,
            registered: Some(errors(&fitted.registered)?),
            after: Some(errors(&fitted.estimated)?),
            unit: "m",
        })
    }

    fn warn(
        &self,
        fitted: &Fitted,
        sets: &[SetResult],
        validation: &[SetResult],
        warnings: &mut Vec<String>,
    ) {
        for set in validation {
            if let (Some(registered), Some(after)) = (&set.registered, &set.after)
                && after.rms > registered.rms
            {
                let distrust = if after.rms > WORSE * registered.rms {
                    DISTRUST
                } else {
                    ""
                };
                warnings.push(format!(
                        "{distrust}the calibrated robot predicts `{}` worse than the registered nominal one: {:.4} mm \
                         against {:.4} mm RMS on rows that were not used",
                        set.name,
                        after.rms * 1e3,
                        registered.rms * 1e3
                    ));
            }
        }
        for (set, result) in self.sets.iter().zip(sets) {
            let far = result.registered.as_ref().is_some_and(|e| e.rms > 0.2);
            if far
                && set.frame.is_none()
                && matches!(set.measured, Measured::Position(_) | Measured::Pose(_))
            {
                warnings.push(format!(
                    "`{}` lies {:.2} m RMS from the registered nominal robot; if its readings are in a sensor's own frame, \
                     say so: frame = \"tracker\"",
                    set.name,
                    result.registered.as_ref().map_or(0.0, |e| e.rms)
                ));
            }
        }
        for (arm, (nominal, estimate)) in self
            .arms
            .iter()
            .zip(fitted.nominal.robots.iter().zip(&fitted.estimated.robots))
        {
            let lengths = arm
                .robot
                .parameters()
                .iter()
                .zip(nominal.iter().zip(estimate));
            let lengths = lengths.filter(|(p, _)| p.unit() == Unit::Meter);
            let (mut total, mut change) = (0.0, 0.0);
            for (_, (nominal, estimate)) in lengths {
                total += nominal.abs();
                change += (estimate - nominal) * (estimate - nominal);
            }
            if change.sqrt() > DEFORMED * total {
                warnings.push(format!(
                    "{DISTRUST}the lengths of {} moved by {:.0} mm in all, of {total:.3} m: the data do not determine \
                     them; add a `prior` about nominal, or measurements that do",
                    if arm.name.is_empty() { arm.robot.name() } else { &arm.name },
                    change.sqrt() * 1e3
                ));
            }
        }
        let mut moved = Vec::new();
        for (arm, (nominal, estimate)) in self
            .arms
            .iter()
            .zip(fitted.nominal.robots.iter().zip(&fitted.estimated.robots))
        {
            for (parameter, (nominal, estimate)) in nominal.iter().zip(estimate).enumerate() {
                let change = estimate - nominal;
                let (limit, text) = match arm.robot.parameters()[parameter].unit() {
                    Unit::Radian => (0.1, format!("{:+.2}°", change.to_degrees())),
                    Unit::Meter => (0.05, format!("{:+.1} mm", change * 1e3)),
                    Unit::One => (0.05, format!("{change:+.3}")),
                };
                if change.abs() > limit {
                    moved.push(format!("{} {text}", arm.parameter_name(parameter)));
                }
            }
        }
        if !moved.is_empty() {
            warnings.push(format!(
                "far from nominal: {}; the data may determine this only weakly (see σ), or the robot file may be wrong",
                shortened(&moved)
            ));
        }
    }
}

/// How a warning starts that makes a result untrusted.
const DISTRUST: &str = "not to be trusted: ";

/// Rows that were not used may be predicted worse than by the registered nominal robot by this
/// factor before the result is distrusted: where a robot is nearly nominal, chance decides.
const WORSE: f64 = 1.1;

/// The lengths of a robot may move by this share of their sum: no drawing is that wrong, but an
/// arm that collapses onto a point moves by as much as it is long.
const DEFORMED: f64 = 0.1;

/// A list in words, its first eight entries if it is longer.
fn shortened(all: &[String]) -> String {
    match all.get(8..) {
        None | Some([]) => all.join(", "),
        Some(rest) => format!("{} and {} more", all[..8].join(", "), rest.len()),
    }
}

/// Whether the files give everything a set's errors depend on.
fn given(set: &MeasurementSet) -> bool {
    let frame = set.frame.is_none() || set.frame_guess.is_some();
    let target = (set.target.is_none() || set.target_guess.is_some()) && set.other_target.is_none();
    let own = !matches!(
        set.measured,
        Measured::UnknownPlane(_)
            | Measured::SamePoint(_)
            | Measured::Distance { distance: None, .. }
    );
    frame && target && own
}

/// The groups of a set that have too few rows, and a warning; an error if all of them have.
fn small_groups(set: &MeasurementSet) -> Result<Option<(Vec<usize>, String)>, Error> {
    let (groups, least, group, row) = match &set.measured {
        Measured::UnknownPlane(groups) => (groups, 4, "plane", "touches"),
        Measured::SamePoint(groups) => (groups, 2, "point", "visits"),
        _ => return Ok(None),
    };
    let counts = groups.counts();
    let small: Vec<usize> = (0..counts.len()).filter(|g| counts[*g] < least).collect();
    let Some(first) = small.first() else {
        return Ok(None);
    };
    let message = match small.as_slice() {
        [only] => format!(
            "`{}`: {group} `{}` has {}; expected at least {least}, for fewer fit any robot",
            set.name,
            groups.names[*only],
            number_of(counts[*only], row)
        ),
        _ => {
            let listed: Vec<String> = small
                .iter()
                .map(|g| format!("`{}` ({})", groups.names[*g], counts[*g]))
                .collect();
            format!(
                "`{}`: {} {group}s have too few {row}: {}; expected at least {least} each, for fewer fit any robot",
                set.name,
                small.len(),
                shortened(&listed)
            )
        }
    };
    if small.len() < counts.len() {
        return Ok(Some((small, format!("{message}; left out"))));
    }
    let help = format!("measure each at least {least} times, or group by another column");
    Err(match &set.origin {
        None => Error::calibration(message, help),
        Some((path, lines)) => {
            let error = InputError::new(path, message).with_help(help);
            let row = groups.of_row.iter().position(|g| g == first);
            match row {
                Some(row) => error.with_line(lines[row]),
                None => error,
            }
            .into()
        }
    })
}

/// "1 touch", "2 touches": `plural` is one of the words used here.
fn number_of(count: usize, plural: &str) -> String {
    let word = match (count, plural) {
        (1, "touches") => "touch",
        (1, "visits") => "visit",
        _ => plural,
    };
    format!("{count} {word}")
}

/// A set without some of its groups; the others are numbered anew.
fn keep_groups(set: &MeasurementSet, without: &[usize]) -> MeasurementSet {
    let (Measured::UnknownPlane(groups) | Measured::SamePoint(groups)) = &set.measured else {
        return set.clone();
    };
    let kept: Vec<usize> = (0..groups.names.len())
        .filter(|g| !without.contains(g))
        .collect();
    let rows: Vec<usize> = (0..set.len())
        .filter(|row| kept.contains(&groups.of_row[*row]))
        .collect();
    let mut set = set.rows(&rows);
    if let Measured::UnknownPlane(groups) | Measured::SamePoint(groups) = &mut set.measured {
        groups.names = kept.iter().map(|g| groups.names[*g].clone()).collect();
        for g in &mut groups.of_row {
            *g = kept.iter().position(|k| k == g).unwrap_or_default();
        }
    }
    set
}

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

/// Puts the result together.
struct Report<'a> {
    calibration: &'a Calibration,
    assembly: &'a Assembly,
    choices: &'a [Choice],
    covariance: Option<&'a Covariance>,
}

impl Report<'_> {
    fn sigma(&self, column: usize) -> Option<f64> {
        let covariance = self.covariance?;
        let sigma = covariance.std_dev(column) * covariance.sigma0();
        (sigma.is_finite() && self.choices[column] == Choice::Estimated).then_some(sigma)
    }

    fn sigmas(&self, first: usize, n: usize) -> Option<Vec<f64>> {
        (first..first + n)
            .map(|column| {
                self.sigma(column)
                    .or(Some(0.0))
                    .filter(|_| self.covariance.is_some())
            })
            .collect()
    }

    fn named(&self, into: &[(usize, f64)]) -> Vec<(String, f64)> {
        into.iter()
            .map(|(c, w)| (self.assembly.columns[*c].name.clone(), *w))
            .collect()
    }

    fn parameters(&self, state: &State) -> Vec<ParameterResult> {
        let arms = &self.calibration.arms;
        let mut results = Vec::new();
        for (column, info) in self.assembly.columns.iter().enumerate() {
            let Owner::Parameter { robot, parameter } = info.owner else {
                continue;
            };
            let p = &arms[robot].robot.parameters()[parameter];
            let (status, into) = match &self.choices[column] {
                Choice::Fixed => (Status::Fixed, None),
                Choice::Estimated => (Status::Estimated, None),
                Choice::NoEffect => (Status::NoEffect, None),
                Choice::Unexcited => (Status::Unexcited, None),
                Choice::Regrouped(into) => {
                    let owner = |c: &usize| &self.assembly.columns[*c].owner;
                    let gauge = into.iter().all(|(c, _)| {
                        matches!(
                            owner(c),
                            Owner::Plane(..) | Owner::Point(..) | Owner::Distance(_)
                        )
                    });
                    let status = if gauge {
                        Status::Held
                    } else {
                        Status::Regrouped
                    };
                    (status, Some(self.named(into)))
                }
                Choice::Anchor(into) => (Status::Held, Some(self.named(into))),
            };
            let estimate = state.robots[robot][parameter];
            let at_bound = self
                .calibration
                .estimate
                .bounds
                .iter()
                .find(|(r, k, ..)| (*r, *k) == (robot, parameter) && status == Status::Estimated)
                .and_then(|(_, _, lower, upper)| {
                    let moved = estimate - p.nominal;
                    let close = 1e-9 * (upper - lower);
                    if moved <= lower + close {
                        Some("lower")
                    } else if moved >= upper - close {
                        Some("upper")
                    } else {
                        None
                    }
                });
            results.push(ParameterResult {
                name: info.name.clone(),
                unit: p.unit().symbol(),
                nominal: p.nominal,
                estimate,
                sigma: self.sigma(column),
                status,
                into,
                at_bound,
            });
        }
        results
    }

    fn make(
        &self,
        state: &State,
        solution: &Solution,
        constraints: Vec<SetResult>,
        validation: Vec<SetResult>,
        warnings: Vec<String>,
    ) -> CalibrationResult {
        let calibration = self.calibration;
        let (mut planes, mut points, mut distances) = (Vec::new(), Vec::new(), Vec::new());
        for (k, set) in calibration.sets.iter().enumerate() {
            let residuals = self.assembly.residuals(k, &solution.values);
            let rms = |groups: &super::measurement::Groups, g: usize| {
                let own: Vec<f64> = residuals
                    .chunks_exact(set.dim())
                    .zip(&groups.of_row)
                    .filter(|(_, h)| **h == g)
                    .map(|(r, _)| r.iter().map(|e| e * e).sum::<f64>().sqrt())
                    .collect();
                (own.len(), ErrorSummary::of(&own).rms)
            };
            match &set.measured {
                Measured::UnknownPlane(groups) => {
                    for (g, plane) in state.planes[k].iter().enumerate() {
                        let (count, rms) = rms(groups, g);
                        planes.push(PlaneEstimate {
                            constraint: set.name.clone(),
                            group: groups.names[g].clone(),
                            count,
                            normal: plane.normal.into(),
                            distance: plane.distance,
                            rms,
                        });
                    }
                }
                Measured::SamePoint(groups) => {
                    for (g, point) in state.points[k].iter().enumerate() {
                        let (count, rms) = rms(groups, g);
                        points.push(PointEstimate {
                            constraint: set.name.clone(),
                            group: groups.names[g].clone(),
                            count,
                            position: (*point).into(),
                            rms,
                        });
                    }
                }
                Measured::Distance { distance: None, .. } => {
                    distances.push((set.name.clone(), state.distances[k]))
                }
                _ => {}
            }
        }
        let frames = state
            .frames
            .iter()
            .map(|(name, pose)| FrameEstimate {
                name: name.clone(),
                position: pose.translation.into(),
                quaternion: pose.quaternion(),
                sigma: self
                    .assembly
                    .frame(name)
                    .and_then(|var| self.sigmas(var.column(), 6)),
            })
            .collect();
        let targets = state
            .targets
            .iter()
            .map(|((robot, name), point)| TargetEstimate {
                name: name.clone(),
                robot: calibration.arms[*robot].name.clone(),
                position: (*point).into(),
                sigma: self
                    .assembly
                    .target(*robot, name)
                    .and_then(|var| self.sigmas(var.column(), 3)),
            })
            .collect();
        let identifiable = (0..self.choices.len())
            .filter(|c| self.choices[*c] == Choice::Estimated)
            .filter(|c| {
                matches!(
                    self.assembly.columns[*c].owner,
                    Owner::Parameter { .. } | Owner::Frame(_) | Owner::Target(..)
                )
            })
            .count();
        let termination = TerminationReport {
            kind: solution.termination.kind().to_owned(),
            converged: solution.termination.converged(),
            message: solution.termination.to_string(),
        };
        CalibrationResult {
            // Where unknowns cannot be told apart, the residual is small at many wrong robots.
            trusted: termination.converged && !warnings.iter().any(|w| w.starts_with(DISTRUST)),
            termination,
            warnings,
            iterations: solution.iterations,
            initial_cost: solution.initial_cost,
            cost: solution.cost,
            sigma0: self
                .covariance
                .map(Covariance::sigma0)
                .filter(|s| s.is_finite()),
            constraints,
            validation,
            parameters: self.parameters(state),
            frames,
            targets,
            planes,
            points,
            distances,
            identifiable,
            condition: self.covariance.map(Covariance::condition),
        }
    }
}
