//! From a calibration file, its robot files and its data to a [`Calibration`].

use super::arms::{read_arms, shown_where_named};
use super::data::Data;
use super::estimate::estimate;
use crate::error::Error;
use crate::estimate::Calibration;
use crate::file::{CalibrationFile, ConstraintSpec};
use crate::measurement::{MeasurementSet, Origin, Readings, Tool};
use crate::plugin::Registry;
use crate::robot::Arm;
use crate::robot::names::listed;
use crate::text::{InputError, Spanned, Table};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Reads the robots and data that a calibration file names.
///
/// # Errors
/// Whatever is wrong with a file, with the place, what was found, what was expected and what to do.
pub fn load(file: &CalibrationFile) -> Result<Calibration, Error> {
    load_with(file, &Registry::default())
}

/// Reads the robots and data that a calibration file names, which may also ask for what plugins have.
///
/// # Errors
/// As [`load`].
pub fn load_with(file: &CalibrationFile, registry: &Registry) -> Result<Calibration, Error> {
    let arms = read_arms(&file.robots, &file.source, registry.models())?;
    let estimate = estimate(&file.estimate, &file.source, &arms, registry)?;
    let mut loader = Loader {
        file,
        registry,
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

/// Two sets that share a frame or a tool point cannot start it at two places.
fn check_guesses(file: &CalibrationFile, sets: &[MeasurementSet]) -> Result<(), InputError> {
    for (k, set) in sets.iter().enumerate() {
        for other in &sets[..k] {
            let frames = set.frame.is_some()
                && set.frame == other.frame
                && set.frame_guess.is_some()
                && other.frame_guess.is_some()
                && set.frame_guess != other.frame_guess;
            let (own, theirs) = (set.tool(), other.tool());
            let targets = own.target.is_some()
                && (own.robot, &own.target) == (theirs.robot, &theirs.target)
                && own.guess.is_some()
                && theirs.guess.is_some()
                && own.guess != theirs.guess;
            let (what, name, key) = match (frames, targets) {
                (true, _) => ("frame", &set.frame, "frame_guess"),
                (_, true) => ("tool point", &own.target, "target_guess"),
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

struct Loader<'a> {
    file: &'a CalibrationFile,
    registry: &'a Registry,
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
        data.check_columns(self.arms, self.registry)?;
        let mut taken = Vec::new();
        let q = data.joints(&self.arms[robot], "", &mut taken)?;
        let (values, changed) = data.values()?;
        if changed > 0 {
            let what = spec.kind.changed();
            self.notes
                .push(format!("`{}`: {changed} {what}", spec.name));
        }
        let groups = data.groups()?;
        let second = self.second(spec, &data, robot, &mut taken)?;
        self.check_targets(spec, robot, second.as_ref())?;
        let target = spec
            .targets
            .as_ref()
            .map(|names| &names[0])
            .or(spec.target.as_ref());
        let guess = spec.target_guess;
        let target = target.map(|t| t.value.clone());
        let sigma = data.sigmas()?;
        let note = note_of_sigma(spec);
        let first = Tool {
            robot,
            q,
            target,
            guess,
        };
        let set = MeasurementSet {
            kind: spec.kind.clone(),
            method: spec.method.as_ref().map(|method| method.value.clone()),
            readings: Readings {
                name: spec.name.clone(),
                tools: std::iter::once(first.clone())
                    .chain(second.map(|second| with_target(second, spec, &first)))
                    .collect(),
                values,
                groups,
                sigma,
                loss: spec.loss,
                frame: spec.frame.as_ref().map(|f| f.value.clone()),
                frame_guess: spec.frame_guess,
                origin: Some(Origin {
                    path: spec.data.clone(),
                    lines: data.rows.iter().map(|row| table.line(*row)).collect(),
                    rows: data.rows.clone(),
                }),
            },
        };
        self.notes.extend(note);
        if let Some(method) = &spec.method {
            let checked = method.value.check(&*set.kind, &set.readings);
            checked.map_err(|message| {
                self.file
                    .error_at(method.span.clone(), message)
                    .with_help("change the measurements, or leave `method` out")
            })?;
        }
        Ok(set)
    }

    /// The second tool of a kind between two: another robot's, or the same in its second posture.
    fn second(
        &self,
        spec: &ConstraintSpec,
        data: &Data<'_>,
        robot: usize,
        taken: &mut Vec<String>,
    ) -> Result<Option<Tool>, InputError> {
        if spec.kind.tools() < 2 {
            return Ok(None);
        }
        let (other, suffix) = match &spec.robots {
            Some(robots) => {
                let other = self.robot_number(Some(&robots[1]))?;
                if other == robot {
                    return Err(self
                        .file
                        .error_at(robots[1].span.clone(), format!("robot `{}` is named twice", robots[1].value))
                        .with_help("name two robots, or one with `robot` and its second posture in columns q1b, q2b, …"));
                }
                (other, "")
            }
            None => (robot, "b"),
        };
        Ok(Some(Tool {
            robot: other,
            q: data.joints(&self.arms[other], suffix, taken)?,
            ..Tool::default()
        }))
    }

    /// Two robots have `targets`, one has a `target`.
    fn check_targets(
        &self,
        spec: &ConstraintSpec,
        robot: usize,
        second: Option<&Tool>,
    ) -> Result<(), InputError> {
        let two = second.is_some_and(|second| second.robot != robot);
        let (wrong, misplaced, help) = if two {
            let help = "there are two robots: write targets = [\"…\", \"…\"]";
            ("target", spec.target.is_some(), help)
        } else {
            let help = "there is one robot: write target = \"…\"";
            ("targets", spec.targets.is_some(), help)
        };
        if !misplaced {
            return Ok(());
        }
        let message = format!("`{wrong}` does not fit this {}", spec.kind.name());
        Err(self
            .file
            .error_at(spec.span_of(wrong), message)
            .with_help(help))
    }
}

/// A standard deviation that was given for the first measurand alone, in words.
fn note_of_sigma(spec: &ConstraintSpec) -> Option<String> {
    let ([Some(_), None, ..], [first, second, ..]) = (&spec.sigma[..], spec.kind.measurands())
    else {
        return None;
    };
    let usual = match second.unit.symbol() {
        "rad" => format!("{} mrad", second.sigma * 1e3),
        unit => format!("{} {unit}", second.sigma),
    };
    Some(format!(
        "`{}`: sigma says nothing of {}s, {usual} is taken; say sigma = {{ {} = \"…\", {} = \"…\" }}",
        spec.name, second.name, first.name, second.name
    ))
}

/// The second tool with its target: that of the file, or the same as the first's in another posture.
fn with_target(second: Tool, spec: &ConstraintSpec, first: &Tool) -> Tool {
    let same = second.robot == first.robot;
    let named = spec.targets.as_ref().map(|names| names[1].value.clone());
    Tool {
        target: named.or_else(|| first.target.clone().filter(|_| same)),
        ..second
    }
}
