//! From a calibration file, its robot files and its data to a [`Calibration`].

use super::measurement::{Arm, Groups, Measured, MeasurementSet, Sigma};
use super::run::{Calibration, Estimate};
use crate::constraint::Derivatives;
use crate::error::Error;
use crate::file::{
    BoundSpec, CalibrationFile, ConstraintSpec, Dimension, DistanceSpec, InputError, JacobianKind,
    Kind, LossSpec, Pattern, PlaneSpec, Quantity, RobotFile, RobotRef, SigmaSpec, SolverKind,
    Source, Spanned, Table, nearest,
};
use crate::kinematics::{JointKind, ParameterKind, Robot, Unit};
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use truing::manifold::{Plane, Pose, so3};
use truing::nalgebra::Vector3;
use truing::{Loss, Method, Settings, Tolerances};

/// Reads the robots and data that a calibration file names.
///
/// # Errors
/// Whatever is wrong with a file, with the place, what was found, what was expected and what to do.
pub fn load(file: &CalibrationFile) -> Result<Calibration, Error> {
    let arms = read_arms(&file.robots, &file.source)?;
    let estimate = estimate(file, &arms)?;
    let mut loader = Loader {
        file,
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

/// The dimension of a unit.
fn dimension_of(unit: Unit) -> Dimension {
    match unit {
        Unit::Radian => Dimension::Angle,
        Unit::Meter => Dimension::Length,
        Unit::One => Dimension::None,
    }
}

/// A quantity in the unit of a parameter [m, rad or 1].
pub(crate) fn in_unit_of(
    arms: &[Arm],
    (robot, parameter): (usize, usize),
    quantity: Quantity,
    source: &Source,
    span: &Range<usize>,
) -> Result<f64, InputError> {
    let dimension = dimension_of(arms[robot].robot.parameters()[parameter].unit());
    quantity
        .expect(dimension)
        .map_err(|e| e.at(source, span.clone(), &arms[robot].parameter_name(parameter)))
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

/// All parameters of all robots by the names a calibration file can use.
pub(crate) struct Names<'a> {
    pub source: &'a Source,
    pub arms: &'a [Arm],
}

impl Names<'_> {
    /// The parameters that a name, pattern or word means and whose unit the quantity has: `"a*"`
    /// with a length means the lengths `a2`, `a3`, … and not the angles `alpha2`, `alpha3`, …. If
    /// none has it, all that are meant, for the error to name one.
    pub fn find_like(
        &self,
        text: &Spanned<String>,
        quantity: Quantity,
    ) -> Result<Vec<(usize, usize)>, InputError> {
        let found = self.find(text)?;
        let alike = |(r, p): &(usize, usize)| {
            quantity.dimension.is_none_or(|dimension| {
                dimension == dimension_of(self.arms[*r].robot.parameters()[*p].unit())
            })
        };
        let like: Vec<(usize, usize)> = found.iter().copied().filter(alike).collect();
        Ok(if like.is_empty() { found } else { like })
    }

    /// The parameters that a name, pattern or word means, in their order.
    pub fn find(&self, text: &Spanned<String>) -> Result<Vec<(usize, usize)>, InputError> {
        let all: Vec<(usize, usize)> = self
            .arms
            .iter()
            .enumerate()
            .flat_map(|(r, arm)| (0..arm.robot.parameters().len()).map(move |p| (r, p)))
            .collect();
        let (prefix, word) = match text.value.split_once('.') {
            Some((prefix, word)) if self.arms.iter().any(|arm| arm.name == prefix) => {
                (Some(prefix), word)
            }
            _ => (None, text.value.as_str()),
        };
        let of_arm =
            |(r, _): &(usize, usize)| prefix.is_none_or(|prefix| self.arms[*r].name == prefix);
        let means = |(r, p): &(usize, usize)| {
            let robot = &self.arms[*r].robot;
            match word {
                "all" => true,
                "base" => robot.base_parameters().contains(p),
                "tool" => robot.tool_parameters().contains(p),
                "gains" => robot.parameters()[*p].kind == ParameterKind::Gain,
                _ => {
                    let pattern = Pattern::new(word);
                    pattern.matches(&robot.parameters()[*p].name)
                }
            }
        };
        let found: Vec<(usize, usize)> = all
            .iter()
            .copied()
            .filter(|k| of_arm(k) && means(k))
            .collect();
        if !found.is_empty() {
            return Ok(found);
        }
        let full: Vec<String> = all
            .iter()
            .map(|(r, p)| self.arms[*r].parameter_name(*p))
            .collect();
        let words = ["all", "base", "tool", "gains"];
        let candidates: Vec<&str> = full.iter().map(String::as_str).chain(words).collect();
        let help = match nearest(&text.value, candidates.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!(
                "there are {}, and the words {}",
                listed(&full),
                words.join(", ")
            ),
        };
        let what = if Pattern::new(text.value.as_str()).is_name() {
            "parameter has the name"
        } else {
            "parameter matches"
        };
        Err(self
            .source
            .error_at(text.span.clone(), format!("no {what} `{}`", text.value))
            .with_help(help))
    }
}

/// A number to six places, without zeros at the end.
fn plain(x: f64) -> String {
    let text = format!("{x:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}

/// A list of names, shortened where it is long.
fn listed(names: &[String]) -> String {
    let shown: Vec<&str> = names.iter().take(12).map(String::as_str).collect();
    let more = if names.len() > shown.len() {
        format!(", … ({} in all)", names.len())
    } else {
        String::new()
    };
    format!("{}{more}", shown.join(", "))
}

fn estimate(file: &CalibrationFile, arms: &[Arm]) -> Result<Estimate, InputError> {
    let spec = &file.estimate;
    let names = Names {
        source: &file.source,
        arms,
    };
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
        in_unit_of(arms, key, quantity, &file.source, span)
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
        JacobianKind::Analytic => {
            return Err(file
                .error_at(spec.spans.of("jacobian"), "the analytic Jacobian is not part of this version")
                .with_help("use \"auto\" (frame-wise automatic differentiation), \"whole-chain\" or \"numeric\""));
        }
    };
    let method = match spec.solver {
        SolverKind::LevenbergMarquardt => Method::LevenbergMarquardt,
        SolverKind::GaussNewton => Method::GaussNewton,
        SolverKind::Dogleg => {
            return Err(file
                .error_at(
                    spec.spans.of("solver"),
                    "the dogleg solver is not part of this version",
                )
                .with_help("use \"levenberg-marquardt\" or \"gauss-newton\""));
        }
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
        settings: Settings {
            method,
            tolerances,
            ..Settings::default()
        },
    })
}

struct Loader<'a> {
    file: &'a CalibrationFile,
    arms: &'a [Arm],
    tables: BTreeMap<PathBuf, Table>,
    notes: Vec<String>,
}

/// The data of one constraint while it is read: a table and the rows in use.
struct Data<'a> {
    file: &'a CalibrationFile,
    spec: &'a ConstraintSpec,
    table: &'a Table,
    rows: Vec<usize>,
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
        let q = data.joints(&self.arms[robot], "")?;
        let measured = match spec.kind {
            Kind::Position => Measured::Position(data.points()?),
            Kind::Pose => {
                let (poses, renormalised) = data.poses()?;
                if renormalised > 0 {
                    self.notes.push(format!("`{}`: {renormalised} quaternions were not quite of unit length and were normalised", spec.name));
                }
                Measured::Pose(poses)
            }
            Kind::KnownPlane => Measured::KnownPlane(known_plane(spec)),
            Kind::UnknownPlane => Measured::UnknownPlane(data.groups("plane")?),
            Kind::SamePoint => Measured::SamePoint(data.groups("point")?),
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
                        let q_b = data.joints(&self.arms[other], "")?;
                        Measured::Distance {
                            other: Some(other),
                            q_b,
                            distance,
                        }
                    }
                    None => {
                        let q_b = data.joints(&self.arms[robot], "b")?;
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
        let loss = match spec.loss {
            LossSpec::Trivial => Loss::Trivial,
            LossSpec::Huber(k) => Loss::Huber(k),
        };
        Ok(MeasurementSet {
            name: spec.name.clone(),
            robot,
            q,
            measured,
            sigma,
            loss,
            target: target.map(|t| t.value.clone()),
            other_target: spec.targets.as_ref().map(|names| names[1].value.clone()),
            target_guess: spec
                .target_guess
                .map(|g| Vector3::new(g[0].value, g[1].value, g[2].value)),
            frame: spec.frame.as_ref().map(|f| f.value.clone()),
            frame_guess: spec.frame_guess.map(|g| {
                Pose::from_quaternion(Vector3::new(g[0], g[1], g[2]), [g[3], g[4], g[5], g[6]])
            }),
            origin: Some((
                spec.data.clone(),
                data.rows.iter().map(|row| table.line(*row)).collect(),
            )),
        })
    }
}

fn known_plane(spec: &ConstraintSpec) -> Plane<f64> {
    // The file layer requires a plane for this kind.
    let (normal, distance) = spec
        .plane
        .map_or(([0.0, 0.0, 1.0], 0.0), PlaneSpec::normalised);
    Plane {
        normal: normal.into(),
        distance,
    }
}

/// The names of the columns that a joint may have, the preferred first; `suffix` marks a second posture.
fn joint_columns(arm: &Arm, joint: usize, suffix: &str) -> Vec<String> {
    let mut names = Vec::new();
    for name in [
        format!("{}{suffix}", arm.robot.joints()[joint].name),
        format!("q{}{suffix}", joint + 1),
    ] {
        if !arm.name.is_empty() {
            names.push(format!("{}.{name}", arm.name));
            names.push(format!("{}_{name}", arm.name));
        }
        names.push(name);
    }
    names
}

/// Whether a standard deviation [m or rad] can weigh a measurement: not zero, nor so small or large that weights overflow.
fn ordinary(sigma: f64) -> bool {
    (1e-12..=1e12).contains(&sigma)
}

impl Data<'_> {
    /// The column a quantity is read from: as mapped, or of its own name.
    fn column(&self, name: &str) -> (String, Option<Range<usize>>) {
        match self.spec.columns.iter().find(|(from, _)| from == name) {
            Some((_, to)) => (to.value.clone(), Some(to.span.clone())),
            None => (name.to_owned(), None),
        }
    }

    fn numbers(&self, name: &str, dimension: Dimension) -> Result<Vec<f64>, InputError> {
        let (column, span) = self.column(name);
        let error = match self
            .table
            .numbers(&column, dimension, &self.spec.units, &self.rows)
        {
            Ok(numbers) => return Ok(numbers),
            Err(error) => error,
        };
        Err(match span {
            // The name in `columns` is wrong, not the data.
            Some(span) if !self.table.has(&column) => error.moved_to(&self.file.source, span),
            _ => error,
        })
    }

    /// Joint values of a robot, one row a measurement; `suffix` marks a second posture.
    fn joints(&self, arm: &Arm, suffix: &str) -> Result<Vec<Vec<f64>>, InputError> {
        let mut q = vec![Vec::with_capacity(arm.robot.joints().len()); self.rows.len()];
        for (k, joint) in arm.robot.joints().iter().enumerate() {
            let dimension = if joint.kind == JointKind::Prismatic {
                Dimension::Length
            } else {
                Dimension::Angle
            };
            let candidates = joint_columns(arm, k, suffix);
            let mapped = candidates
                .iter()
                .find(|name| self.spec.columns.iter().any(|(from, _)| from == *name));
            let name = mapped.or_else(|| candidates.iter().find(|name| self.table.has(name)));
            let values = match (name, joint.value) {
                (Some(name), _) => self.numbers(name, dimension)?,
                (None, Some(value)) => vec![value; self.rows.len()],
                (None, None) => {
                    let columns: Vec<String> =
                        self.table.column_names().map(str::to_owned).collect();
                    let wanted = match candidates[0]
                        .contains(|c: char| !(c.is_ascii_alphanumeric() || "_-".contains(c)))
                    {
                        true => format!("\"{}\"", candidates[0]),
                        false => candidates[0].clone(),
                    };
                    // A column that is another joint's is not this one's with a slip of the pen.
                    let joints = 0..arm.robot.joints().len();
                    let taken: Vec<String> =
                        joints.flat_map(|k| joint_columns(arm, k, "")).collect();
                    let free = columns.iter().filter(|column| !taken.contains(column));
                    let near = nearest(&candidates[0], free.map(String::as_str));
                    let column = near.unwrap_or("…");
                    return Err(self.table.header_error(format!(
                        "there is no column for joint `{}{suffix}`; the columns are {}",
                        joint.name,
                        listed(&columns)
                    ))
                    .with_help(format!(
                        "say in the calibration file which it is, columns = {{ {wanted} = \"{column}\" }}; \
                         if the joint is parked, give it a `value` in the robot file"
                    )));
                }
            };
            for (row, value) in q.iter_mut().zip(values) {
                row.push(value);
            }
        }
        Ok(q)
    }

    /// Every name in `columns` must be one that is read.
    fn check_columns(&self, arms: &[Arm]) -> Result<(), InputError> {
        let measured = [
            "x", "y", "z", "qw", "qx", "qy", "qz", "sigma", "plane", "point",
        ];
        let mut known: Vec<String> = measured.map(str::to_owned).to_vec();
        known.extend(self.spec.group.iter().cloned());
        for arm in arms {
            for k in 0..arm.robot.joints().len() {
                known.extend(joint_columns(arm, k, ""));
                if self.spec.kind == Kind::Distance {
                    known.extend(joint_columns(arm, k, "b"));
                }
            }
        }
        let unknown = self
            .spec
            .columns
            .iter()
            .find(|(name, _)| !known.contains(name));
        let Some((name, column)) = unknown else {
            return Ok(());
        };
        let joints: Vec<String> = arms
            .iter()
            .flat_map(|arm| {
                (0..arm.robot.joints().len()).map(|k| joint_columns(arm, k, "").swap_remove(0))
            })
            .collect();
        let help = match nearest(name, known.iter().map(String::as_str)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!(
                "what is read is {}, and the joints {}",
                measured.join(", "),
                listed(&joints)
            ),
        };
        let message = format!("`columns`: nothing is read as `{name}`");
        Err(self
            .file
            .error_at(column.span.clone(), message)
            .with_help(help))
    }

    fn points(&self) -> Result<Vec<Vector3<f64>>, InputError> {
        let [x, y, z] = ["x", "y", "z"].map(|name| self.numbers(name, Dimension::Length));
        let (x, y, z) = (x?, y?, z?);
        Ok((0..self.rows.len())
            .map(|k| Vector3::new(x[k], y[k], z[k]))
            .collect())
    }

    /// The poses, and how many quaternions had to be normalised.
    fn poses(&self) -> Result<(Vec<Pose<f64>>, usize), InputError> {
        let points = self.points()?;
        let [w, x, y, z] = ["qw", "qx", "qy", "qz"].map(|name| self.numbers(name, Dimension::None));
        let (w, x, y, z) = (w?, x?, y?, z?);
        let mut renormalised = 0;
        let mut poses = Vec::with_capacity(points.len());
        for (k, point) in points.into_iter().enumerate() {
            let q = [w[k], x[k], y[k], z[k]];
            let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
            if (length - 1.0).abs() > 0.01 {
                return Err(self
                    .table
                    .error_at(
                        self.rows[k],
                        format!(
                            "the quaternion ({:.4}, {:.4}, {:.4}, {:.4}) has length {length:.4}; expected 1",
                            q[0], q[1], q[2], q[3]
                        ),
                    )
                    .with_help("give unit quaternions as qw, qx, qy, qz (w first)"));
            }
            if (length - 1.0).abs() > 1e-5 {
                renormalised += 1;
            }
            let unit = q.map(|c| c / length);
            poses.push(Pose {
                rotation: so3::quaternion_matrix(&unit),
                translation: point,
            });
        }
        Ok((poses, renormalised))
    }

    fn groups(&self, default: &str) -> Result<Groups, InputError> {
        let names: Vec<String> = if self.spec.group.is_empty() {
            vec![default.to_owned()]
        } else {
            self.spec.group.clone()
        };
        let mut labels = vec![Vec::new(); self.rows.len()];
        for name in &names {
            let (column, _) = self.column(name);
            if !self.table.has(&column) {
                if self.spec.group.is_empty() && default == "plane" {
                    // Without a column all touches are of one plane.
                    return Ok(Groups::by_label(
                        self.rows.iter().map(|_| "plane".to_owned()),
                    ));
                }
                let columns: Vec<String> = self.table.column_names().map(str::to_owned).collect();
                return Err(self
                    .file
                    .error_at(
                        self.spec.span_of("group"),
                        format!("`{}` has no column `{column}` to group by; its columns are {}", self.spec.name, listed(&columns)),
                    )
                    .with_help(match nearest(&column, self.table.column_names()) {
                        Some(near) => format!("did you mean `{near}`?"),
                        None => "name the columns that tell one plane or point from another, like group = [\"plane\", \"rep\"]".to_owned(),
                    }));
            }
            let cells = self.table.strings(&column, &self.rows)?;
            for ((label, cell), row) in labels.iter_mut().zip(cells).zip(&self.rows) {
                if cell.is_empty() {
                    let message = format!(
                        "column `{column}`: found an empty cell; expected the name of a group"
                    );
                    return Err(self
                        .table
                        .error_at(*row, message)
                        .with_help("fill it in, or leave the row out with `rows`"));
                }
                label.push(cell.to_owned());
            }
        }
        Ok(Groups::by_label(
            labels.into_iter().map(|label| label.join("/")),
        ))
    }

    fn sigmas(&self) -> Result<Vec<Sigma>, InputError> {
        let mut sigma = Sigma::default();
        match self.spec.sigma {
            None => {}
            Some(SigmaSpec::Single(quantity)) => {
                sigma.position = quantity.value;
                if self.spec.kind == Kind::Pose && quantity.dimension.is_none() {
                    sigma.rotation = quantity.value;
                }
            }
            Some(SigmaSpec::Pose { position, rotation }) => sigma = Sigma { position, rotation },
        }
        if let Some(wrong) = [sigma.position, sigma.rotation]
            .into_iter()
            .find(|s| !ordinary(*s))
        {
            let message =
                format!("`sigma`: found {wrong:e}; expected a standard deviation of ordinary size");
            return Err(self
                .file
                .error_at(self.spec.span_of("sigma"), message)
                .with_help("write the standard deviation of one measurement, like \"0.1 mm\""));
        }
        let mut sigmas = vec![sigma; self.rows.len()];
        let (column, _) = self.column("sigma");
        if self.table.has(&column) {
            for (k, value) in self
                .numbers("sigma", Dimension::Length)?
                .into_iter()
                .enumerate()
            {
                if !ordinary(value) {
                    return Err(self
                        .table
                        .error_at(self.rows[k], format!("column `{column}`: found {value}; expected a standard deviation above 0, of ordinary size"))
                        .with_help("correct the row, or leave it out with `rows`"));
                }
                sigmas[k].position = value;
            }
        }
        Ok(sigmas)
    }
}
