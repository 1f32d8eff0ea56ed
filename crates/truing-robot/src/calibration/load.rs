//! From a calibration file, its robot files and its data to a [`Calibration`].

use super::data::{Data, known_plane};
use super::far::Strategy;
use super::form::{Form, Plugin};
use super::measurement::{Arm, Measured, MeasurementSet, Origin};
use super::names::{Names, in_unit_of, listed, plain};
use super::run::{Calibration, Estimate};
use crate::constraint::Derivatives;
use crate::error::Error;
use crate::file::{
    BoundSpec, CalibrationFile, ConstraintSpec, DistanceSpec, EstimateSpec, InputError,
    JacobianKind, Kind, Quantity, RobotFile, RobotRef, SigmaSpec, SolverKind, Source, Spanned,
    StrategyKind, Table, nearest,
};
use crate::kinematics::{Robot, Unit};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use truing::manifold::Pose;
use truing::nalgebra::Vector3;
use truing::{Method, Settings, Tolerances};

/// Reads the robots and data that a calibration file names.
///
/// # Errors
/// Whatever is wrong with a file, with the place, what was found, what was expected and what to do.
pub fn load(file: &CalibrationFile) -> Result<Calibration, Error> {
    load_with(file, &[])
}

/// Reads the robots and data that a calibration file names, which may also ask for what plugins have.
///
/// # Errors
/// As [`load`].
pub fn load_with(file: &CalibrationFile, plugins: &[&dyn Plugin]) -> Result<Calibration, Error> {
    let arms = read_arms(&file.robots, &file.source)?;
    let estimate = estimate(&file.estimate, &file.source, &arms, plugins)?;
    let mut loader = Loader {
        file,
        plugins,
        arms: &arms,
        tables: BTreeMap::new(),
        notes: Vec::new(),
    };
    let (mut sets, mut held_out) = (Vec::new(), Vec::new());
    for (k, spec) in file.constraints.iter().enumerate() {
        let set = loader.set(spec)?;
        match &spec.holdout {
            None => sets.push(set),
            Some(holdout) => {
                let (out, used): (Vec<usize>, Vec<usize>) =
                    (0..set.len()).partition(|row| holdout.holds_out(*row));
                if used.is_empty() {
                    let message = format!(
                        "all {} rows of `{}` are held out; expected some to estimate from",
                        set.len(),
                        set.name
                    );
                    return Err(file
                        .error_at(spec.span_of("holdout"), message)
                        .with_help("hold fewer rows out, or add data")
                        .into());
                }
                if !out.is_empty() {
                    held_out.push((k, set.rows(&out)));
                }
                sets.push(set.rows(&used));
            }
        }
    }
    let validate = file
        .validate
        .iter()
        .map(|spec| loader.set(spec))
        .collect::<Result<_, _>>()?;
    let notes = loader.notes;
    check_guesses(file, &sets)?;
    Ok(Calibration {
        arms,
        sets,
        held_out,
        validate,
        estimate,
        notes,
    })
}

/// Reads robots from their files.
pub(crate) fn read_arms(robots: &[RobotRef], source: &Source) -> Result<Vec<Arm>, InputError> {
    let read = |robot: &RobotRef| {
        let file = RobotFile::read(&robot.file)
            .map_err(|error| shown_where_named(error, &robot.file, source, robot.span.clone()))?;
        Ok(Arm {
            name: robot.name.clone(),
            robot: Robot::new(&file),
        })
    };
    robots.iter().map(read).collect()
}

/// A file that is not there is an error of the file that names it; what is wrong inside stays there.
fn shown_where_named(
    error: InputError,
    path: &Path,
    source: &Source,
    span: Range<usize>,
) -> InputError {
    let found = if path.is_dir() {
        "is a folder; expected a file"
    } else if path.exists() {
        return error;
    } else {
        "does not exist"
    };
    source
        .error_at(span, format!("{} {found}", path.display()))
        .with_help("check the path: one inside a file is relative to that file's folder")
}

/// Two sets that share a frame or a tool point cannot start it at two places.
fn check_guesses(file: &CalibrationFile, sets: &[MeasurementSet]) -> Result<(), InputError> {
    for (k, set) in sets.iter().enumerate() {
        for other in &sets[..k] {
            let frames = set.frame.is_some()
                && set.frame == other.frame
                && set.frame_guess.is_some()
                && other.frame_guess.is_some()
                && set.frame_guess != other.frame_guess;
            let targets = set.target.is_some()
                && (set.robot, &set.target) == (other.robot, &other.target)
                && set.target_guess.is_some()
                && other.target_guess.is_some()
                && set.target_guess != other.target_guess;
            let (what, name, key) = match (frames, targets) {
                (true, _) => ("frame", &set.frame, "frame_guess"),
                (_, true) => ("tool point", &set.target, "target_guess"),
                _ => continue,
            };
            let name = name.as_deref().unwrap_or_default();
            let message = format!(
                "the {what} `{name}` starts elsewhere in `{}` than in `{}`",
                set.name, other.name
            );
            return Err(file
                .error_at(file.constraints[k].span_of(key), message)
                .with_help(format!("give the guess once, or name two {what}s")));
        }
    }
    Ok(())
}

/// What to estimate, and how, by the names of the robots' parameters; `file` for the places of errors.
pub(crate) fn estimate(
    spec: &EstimateSpec,
    file: &Source,
    arms: &[Arm],
    plugins: &[&dyn Plugin],
) -> Result<Estimate, InputError> {
    let names = Names { source: file, arms };
    let mut wanted: Vec<Vec<bool>> = arms
        .iter()
        .map(|arm| vec![false; arm.robot.parameters().len()])
        .collect();
    for text in &spec.parameters {
        for (r, p) in names.find(text)? {
            wanted[r][p] = true;
        }
    }
    for text in &spec.fixed {
        for (r, p) in names.find(text)? {
            wanted[r][p] = false;
        }
    }
    let in_unit = |quantity: Quantity, key: (usize, usize), span: &Range<usize>| {
        in_unit_of(arms, key, quantity, file, span)
    };
    let mut bounds = BTreeMap::new();
    for (text, bound) in &spec.bounds {
        let example = match bound {
            BoundSpec::Around(width) => *width,
            BoundSpec::Range(lower, _) => *lower,
        };
        for key in names.find_like(text, example)? {
            let nominal = arms[key.0].robot.parameters()[key.1].nominal;
            let (lower, upper) = match bound {
                BoundSpec::Around(width) => {
                    let width = in_unit(*width, key, &text.span)?;
                    (-width, width)
                }
                BoundSpec::Range(lower, upper) => (
                    in_unit(*lower, key, &text.span)? - nominal,
                    in_unit(*upper, key, &text.span)? - nominal,
                ),
            };
            // A bound at the nominal value may miss it by the rounding of its unit.
            let rounding = 4.0 * f64::EPSILON * nominal.abs();
            if !(lower <= rounding && upper >= -rounding) {
                let (factor, symbol) = match arms[key.0].robot.parameters()[key.1].unit() {
                    Unit::Radian => (1f64.to_degrees(), " deg"),
                    Unit::Meter => (1e3, " mm"),
                    Unit::One => (1.0, ""),
                };
                let shown = |x: f64| plain(x * factor);
                let message = format!(
                    "the bounds [{}, {}]{symbol} exclude the nominal value {}{symbol} of {}",
                    shown(lower + nominal),
                    shown(upper + nominal),
                    shown(nominal),
                    arms[key.0].parameter_name(key.1)
                );
                return Err(file.error_at(text.span.clone(), message).with_help(
                    "widen the bounds, or give a distance from nominal, like \"5 mm\"",
                ));
            }
            bounds.insert(key, (lower.min(0.0), upper.max(0.0)));
        }
    }
    let mut priors = BTreeMap::new();
    for (text, sigma) in &spec.prior {
        for key in names.find_like(text, *sigma)? {
            priors.insert(key, in_unit(*sigma, key, &text.span)?);
        }
    }
    let mut preference = Vec::new();
    for text in &spec.preference {
        for key in names.find(text)? {
            if !preference.contains(&key) {
                preference.push(key);
            }
        }
    }
    let derivatives = match spec.jacobian {
        JacobianKind::Auto => Derivatives::default(),
        JacobianKind::WholeChain => Derivatives::WholeChain,
        JacobianKind::Numeric => Derivatives::Numeric,
        JacobianKind::Analytic => match plugins.iter().find_map(|plugin| plugin.analytic()) {
            Some(columns) => Derivatives::Regressor(columns),
            None => {
                return Err(file
                        .error_at(spec.spans.of("jacobian"), "no plugin has an analytic Jacobian")
                        .with_help("use \"auto\" (frame-wise automatic differentiation), \"whole-chain\" or \"numeric\""));
            }
        },
    };
    let method = match spec.solver {
        SolverKind::LevenbergMarquardt => Method::LevenbergMarquardt,
        SolverKind::GaussNewton => Method::GaussNewton,
        SolverKind::LineSearch => Method::LineSearch,
        SolverKind::Dogleg => Method::Dogleg,
    };
    let mut tolerances = Tolerances::default();
    if let Some(limit) = spec.max_iterations {
        tolerances.max_iterations = limit as u64;
    }
    Ok(Estimate {
        wanted,
        bounds: bounds
            .into_iter()
            .map(|((r, p), (l, u))| (r, p, l, u))
            .collect(),
        priors: priors.into_iter().map(|((r, p), s)| (r, p, s)).collect(),
        preference,
        derivatives,
        from: None,
        strategy: match spec.strategy {
            StrategyKind::Auto => Strategy::Auto,
            StrategyKind::Direct => Strategy::Direct,
        },
        settings: Settings {
            method,
            tolerances,
            ..Settings::default()
        },
    })
}

struct Loader<'a> {
    file: &'a CalibrationFile,
    plugins: &'a [&'a dyn Plugin],
    arms: &'a [Arm],
    tables: BTreeMap<PathBuf, Table>,
    notes: Vec<String>,
}

impl Loader<'_> {
    fn robot_number(&self, name: Option<&Spanned<String>>) -> Result<usize, InputError> {
        match name {
            None => Ok(0),
            Some(text) => self
                .arms
                .iter()
                .position(|arm| arm.name == text.value)
                .ok_or_else(|| {
                    let names: Vec<String> = self.arms.iter().map(|arm| arm.name.clone()).collect();
                    self.file
                        .error_at(
                            text.span.clone(),
                            format!("there is no robot `{}`", text.value),
                        )
                        .with_help(format!("the robots are {}", listed(&names)))
                }),
        }
    }

    fn set(&mut self, spec: &ConstraintSpec) -> Result<MeasurementSet, InputError> {
        if !self.tables.contains_key(&spec.data) {
            let table = Table::read(&spec.data).map_err(|error| {
                let span = spec.span_of("data");
                shown_where_named(error, &spec.data, &self.file.source, span)
            })?;
            self.tables.insert(spec.data.clone(), table);
        }
        let table = &self.tables[&spec.data];
        let rows = match &spec.rows {
            None => (0..table.len()).collect(),
            Some(selection) => selection
                .value
                .apply(table)
                .map_err(|e| e.moved_to(&self.file.source, selection.span.clone()))?,
        };
        let form = match &spec.method {
            Some(method) => Some(self.form(method, spec.kind)?),
            None => None,
        };
        let data = Data {
            file: self.file,
            spec,
            table,
            rows,
        };
        let first = spec
            .robots
            .as_ref()
            .map(|robots| &robots[0])
            .or(spec.robot.as_ref());
        let robot = self.robot_number(first)?;
        data.check_columns(self.arms)?;
        let mut taken = Vec::new();
        let q = data.joints(&self.arms[robot], "", &mut taken)?;
        let measured = match spec.kind {
            Kind::Position => Measured::Position(data.points()?),
            Kind::Pose => {
                let (poses, renormalised) = data.poses()?;
                if renormalised > 0 {
                    self.notes.push(format!("`{}`: {renormalised} quaternions were not quite of unit length and were normalised", spec.name));
                }
                Measured::Pose(poses)
            }
            Kind::KnownPlane => {
                let fixed = spec.method.as_ref().and_then(|method| {
                    self.plugins
                        .iter()
                        .find_map(|plugin| plugin.fixed_plane(&method.value))
                });
                Measured::KnownPlane(known_plane(self.file, spec, fixed)?)
            }
            Kind::UnknownPlane => Measured::UnknownPlane(data.groups("plane")?),
            Kind::SamePoint => Measured::SamePoint(data.groups("point")?),
            Kind::SameLocation => Measured::SameLocation(data.groups("location")?),
            Kind::Distance => {
                let distance = match spec.distance {
                    Some(DistanceSpec::Value(distance)) => Some(distance),
                    _ => None,
                };
                match &spec.robots {
                    Some(robots) => {
                        let other = self.robot_number(Some(&robots[1]))?;
                        if other == robot {
                            return Err(self
                                .file
                                .error_at(robots[1].span.clone(), format!("robot `{}` is named twice", robots[1].value))
                                .with_help("name two robots, or one with `robot` and its second posture in columns q1b, q2b, …"));
                        }
                        let q_b = data.joints(&self.arms[other], "", &mut taken)?;
                        Measured::Distance {
                            other: Some(other),
                            q_b,
                            distance,
                        }
                    }
                    None => {
                        let q_b = data.joints(&self.arms[robot], "b", &mut taken)?;
                        Measured::Distance {
                            other: None,
                            q_b,
                            distance,
                        }
                    }
                }
            }
        };
        let two = matches!(&measured, Measured::Distance { other: Some(_), .. });
        let (wrong, help) = if two {
            (
                "target",
                "there are two robots: write targets = [\"…\", \"…\"]",
            )
        } else {
            ("targets", "there is one robot: write target = \"…\"")
        };
        let misplaced = if two {
            spec.target.is_some()
        } else {
            spec.targets.is_some()
        };
        if misplaced {
            let message = format!("`{wrong}` does not fit this distance");
            return Err(self
                .file
                .error_at(spec.span_of(wrong), message)
                .with_help(help));
        }
        let target = spec
            .targets
            .as_ref()
            .map(|names| &names[0])
            .or(spec.target.as_ref());
        let sigma = data.sigmas()?;
        let one_length = matches!(spec.sigma, Some(SigmaSpec::Single(q)) if q.dimension.is_some());
        if spec.kind.has_rotation() && one_length {
            self.notes.push(format!(
                "`{}`: sigma says nothing of rotations, 0.1 mrad is taken; say sigma = {{ position = \"…\", rotation = \"…\" }}",
                spec.name
            ));
        }
        let mut set = MeasurementSet {
            name: spec.name.clone(),
            robot,
            q,
            measured,
            sigma,
            loss: spec.loss,
            target: target.map(|t| t.value.clone()),
            other_target: spec.targets.as_ref().map(|names| names[1].value.clone()),
            target_guess: spec
                .target_guess
                .map(|g| Vector3::new(g[0].value, g[1].value, g[2].value)),
            frame: spec.frame.as_ref().map(|f| f.value.clone()),
            frame_guess: spec.frame_guess.map(|g| {
                Pose::from_quaternion(Vector3::new(g[0], g[1], g[2]), [g[3], g[4], g[5], g[6]])
            }),
            origin: Some(Origin {
                path: spec.data.clone(),
                lines: data.rows.iter().map(|row| table.line(*row)).collect(),
                rows: data.rows.clone(),
            }),
            form: None,
        };
        if let (Some(form), Some(method)) = (form, &spec.method) {
            form.check(&set).map_err(|message| {
                self.file
                    .error_at(method.span.clone(), message)
                    .with_help("change the measurements, or leave `method` out")
            })?;
            set.form = Some(form);
        }
        Ok(set)
    }

    /// The form that a method is for a kind.
    fn form(&self, method: &Spanned<String>, kind: Kind) -> Result<Arc<dyn Form>, InputError> {
        let found = self
            .plugins
            .iter()
            .find_map(|plugin| plugin.form(&method.value, kind));
        if let Some(form) = found {
            return Ok(form);
        }
        let all: Vec<(&str, Kind)> = self.plugins.iter().flat_map(|p| p.methods()).collect();
        let kinds = all.iter().filter(|(name, _)| *name == method.value);
        let kinds: Vec<String> = kinds.map(|(_, kind)| kind.name().to_owned()).collect();
        let message = if kinds.is_empty() {
            format!("there is no method `{}`", method.value)
        } else {
            format!(
                "the method `{}` is for {}, not for {}",
                method.value,
                listed(&kinds),
                kind.name()
            )
        };
        let names: Vec<&str> = all
            .iter()
            .filter(|(_, k)| *k == kind)
            .map(|(m, _)| *m)
            .collect();
        let help = match (nearest(&method.value, names.iter().copied()), &names[..]) {
            (Some(near), _) => format!("did you mean `{near}`?"),
            (None, []) => format!("leave `method` out: {} has none", kind.name()),
            (None, names) => format!("the methods for {} are {}", kind.name(), names.join(", ")),
        };
        Err(self
            .file
            .error_at(method.span.clone(), message)
            .with_help(help))
    }
}
