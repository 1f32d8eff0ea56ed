//! From a simulation file to data: true robots, planes and points, and measurements of them.

use super::simulated::Simulated;
use crate::error::Error;
use crate::file::{ErrorSpec, SimulationFile, SimulationSpec};
use crate::load::{Names, in_unit_of, read_arms};
use crate::measurement::{
    Groups, Kind, MeasurementSet, Placed, Places, Rows, Sampling, SceneGroups, TargetKind, sample,
};
use crate::plugin::Registry;
use crate::robot::{Arm, Robot, Unit};
use crate::text::{InputError, Source};
use crate::unknown::{Key, State, Value};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{StandardNormal, StandardUniform};
use std::sync::Arc;
use truing::manifold::{Point3, Pose3};
use truing::nalgebra::Vector3;

/// The parameters of a robot with random errors of the given sizes (uniform, ±), for the parameters
/// that `chosen` names.
pub fn perturbed(
    robot: &Robot,
    errors: &ErrorSpec,
    chosen: impl Fn(usize) -> bool,
    rng: &mut impl Rng,
) -> Vec<f64> {
    let mut values = robot.nominal();
    for (k, parameter) in robot.parameters().iter().enumerate() {
        // Drawn for every parameter, so that choosing others does not change the draw of these.
        let draw: f64 = if errors.normal {
            rng.sample(StandardNormal)
        } else {
            2.0 * rng.sample::<f64, _>(StandardUniform) - 1.0
        };
        let size = match parameter.unit() {
            Unit::Radian => errors.angle,
            Unit::Meter => errors.length,
            Unit::One => errors.gain,
            // Of models: errors of their size are given by name.
            Unit::Other(_) => 0.0,
        };
        if chosen(k) {
            values[k] += size * draw;
        }
    }
    values
}

/// Draws the data that a simulation file asks for; the same file and seed always give the same data.
///
/// # Errors
/// Whatever is wrong with a file, or a plane, point or distance that is out of reach.
pub fn simulate(file: &SimulationFile, seed: Option<u64>) -> Result<Simulated, Error> {
    simulate_with(file, seed, &Registry::default())
}

/// The same for a file whose robots may be of models that plugins bring.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_with(
    file: &SimulationFile,
    seed: Option<u64>,
    registry: &Registry,
) -> Result<Simulated, Error> {
    let arms = read_arms(&file.robots, &file.source, registry.models())?;
    let seed = seed.unwrap_or(file.seed);
    let mut truth = State::of(true_robots(file, &arms, seed)?);
    let (mut sets, mut files) = (Vec::new(), Vec::new());
    for (k, spec) in file.constraints.iter().enumerate() {
        // Each constraint draws from a stream of its own: adding one leaves the others as they were.
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(k as u64 + 1);
        let template = template(&file.source, &arms, spec, &mut truth, &mut rng)?;
        let sampling = Sampling {
            count: spec.count,
            noise: Some(&noise(spec)),
            near: None,
        };
        let set = sample(&arms, &template, &truth, &sampling, &mut rng);
        sets.push(set.map_err(|error| at_its_table(error, file, spec))?);
        files.push(spec.data.value.clone());
    }
    Ok(Simulated {
        arms,
        truth,
        sets,
        files,
    })
}

fn true_robots(file: &SimulationFile, arms: &[Arm], seed: u64) -> Result<Vec<Vec<f64>>, Error> {
    let names = Names {
        source: &file.source,
        arms,
    };
    let errors = &file.errors;
    let mut chosen: Vec<Vec<bool>> = arms
        .iter()
        .map(|arm| vec![false; arm.robot.parameters().len()])
        .collect();
    for (texts, choice) in [(&errors.parameters, true), (&errors.fixed, false)] {
        for text in texts {
            for (r, p) in names.find(text)? {
                chosen[r][p] = choice;
            }
        }
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut robots: Vec<Vec<f64>> = arms
        .iter()
        .zip(&chosen)
        .map(|(arm, chosen)| perturbed(&arm.robot, errors, |k| chosen[k], &mut rng))
        .collect();
    for (text, error) in &errors.given {
        for (r, p) in names.find_like(text, *error)? {
            let error = in_unit_of(arms, (r, p), *error, &file.source, &text.span)?;
            robots[r][p] = arms[r].robot.parameters()[p].nominal + error;
        }
    }
    Ok(robots)
}

/// The noise that a constraint asks for, one standard deviation a measurand.
pub(crate) fn noise(spec: &SimulationSpec) -> Vec<f64> {
    let given = spec.sigma.iter();
    given.map(|sigma| sigma.unwrap_or_default()).collect()
}

/// A set without rows, and its frame, target and unknowns put into the truth.
pub(crate) fn template(
    source: &Source,
    arms: &[Arm],
    spec: &SimulationSpec,
    truth: &mut State,
    rng: &mut ChaCha8Rng,
) -> Result<MeasurementSet, Error> {
    let number = |name: Option<&str>| {
        name.and_then(|name| arms.iter().position(|arm| arm.name == name))
            .unwrap_or(0)
    };
    let first = spec.robots.as_ref().map(|r| &r[0]).or(spec.robot.as_ref());
    let robot = number(first.map(|name| name.value.as_str()));
    place_shared(source, spec, robot, truth)?;
    let mut places = Places {
        robot: &arms[robot].robot,
        parameters: &truth.robots[robot].clone(),
        target: match spec.target {
            Some(_) => spec.target_position.translation,
            None => Vector3::zeros(),
        },
        middle: false,
        rng,
    };
    let start = spec.scene.kind.as_ref().unwrap_or(&spec.kind);
    let mut kind: Arc<dyn Kind> = start.clone();
    let groups: Vec<Vec<Value>> = match &spec.scene.groups {
        SceneGroups::Given(values) => values.clone(),
        SceneGroups::Drawn(count) => {
            let mut all = Vec::new();
            for _ in 0..*count {
                let Placed {
                    kind: drawn,
                    values,
                } = start.place(&mut places);
                kind = drawn.unwrap_or(kind);
                all.push(values);
            }
            all
        }
    };
    let names: Vec<String> = match kind.grouping() {
        Some(_) => (1..=groups.len()).map(|k| k.to_string()).collect(),
        None => vec![String::new()],
    };
    for (group, values) in names.iter().zip(groups) {
        for (unknown, value) in kind.unknowns().iter().zip(values) {
            truth.set_own(&spec.name, group, unknown.name, value);
        }
    }
    let columns = kind.columns().len();
    let mut set = MeasurementSet::of(&spec.name, kind, Vec::new(), Rows::new(columns)).robot(robot);
    set.readings.groups = Groups {
        names,
        of_row: Vec::new(),
    };
    set.readings.frame = spec.frame.as_ref().map(|f| f.value.clone());
    let other = spec
        .robots
        .as_ref()
        .map(|names| number(Some(names[1].value.as_str())));
    if let (Some(second), Some(other)) = (set.readings.tools.get_mut(1), other) {
        second.robot = other;
    }
    if let Some(target) = &spec.target {
        set = set.target(&target.value);
    }
    Ok(set)
}

/// The sensor frame and the target of a constraint, put into the truth.
fn place_shared(
    source: &Source,
    spec: &SimulationSpec,
    robot: usize,
    truth: &mut State,
) -> Result<(), Error> {
    let target = spec.target_position;
    if let Some(name) = &spec.target {
        let value = match spec.kind.targets() {
            TargetKind::Point => Value::of::<Point3>(target.translation),
            TargetKind::Body => Value::of::<Pose3>(target),
        };
        let key = Key::Target(robot, name.value.clone());
        let known = truth.set(key, value.clone());
        let differs = known.is_some_and(|known| known != value);
        differ(source, spec, "target_position", differs)?;
    } else if target.translation != Vector3::zeros() {
        return Err(source
            .error_at(
                spec.spans.of("target_position"),
                "the tool point has no name",
            )
            .with_help("name it: target = \"s1\"")
            .into());
    }
    if let Some(name) = &spec.frame {
        let value = Value::of::<Pose3>(spec.frame_pose);
        let key = Key::Frame(name.value.clone());
        let known = truth.set(key, value.clone());
        let differs = known.is_some_and(|known| known != value);
        differ(source, spec, "frame_pose", differs)?;
    }
    Ok(())
}

/// What is out of reach is so at the table that asks for it.
fn at_its_table(error: Error, file: &SimulationFile, spec: &SimulationSpec) -> Error {
    match error {
        Error::Unreachable { message, help } => file
            .error_at(spec.spans.table(), message)
            .with_help(help)
            .into(),
        other => other,
    }
}

/// Refuses a frame or tool point that two constraints put at different places.
fn differ(
    source: &Source,
    spec: &SimulationSpec,
    key: &str,
    differs: bool,
) -> Result<(), InputError> {
    if !differs {
        return Ok(());
    }
    Err(source
        .error_at(
            spec.spans.of(key),
            "an earlier constraint put it somewhere else",
        )
        .with_help("give the same place, or use two names"))
}
