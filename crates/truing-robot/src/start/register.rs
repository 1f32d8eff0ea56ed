//! Registering sensor frames together with the tool points that the sensor sees.

use super::hand_eye::{Pair, body_seen, hand_eye, sensor_of};
use crate::measurement::fit::{mean, rigid_registration};
use crate::measurement::{At, MeasurementSet, Seen, TargetKind};
use crate::robot::Arm;
use crate::unknown::{Key, State, Value};
use std::collections::{BTreeMap, BTreeSet};
use truing::manifold::{Point3, Pose, Pose3};
use truing::nalgebra::{DMatrix, DVector, Vector3};

/// Tool points by robot and name \[m\].
type Targets = BTreeMap<(usize, String), Vector3<f64>>;

/// One reading of a sensor: what it saw, with the tool pose of the nominal robot.
struct Reading {
    seen: Vector3<f64>,
    /// The orientation too, of a body whose pose was read.
    pose: Option<Pose<f64>>,
    tool: Pose<f64>,
    target: Option<(usize, String)>,
}

fn readings(arms: &[Arm], sets: &[&MeasurementSet], state: &State) -> Vec<Reading> {
    let mut all = Vec::new();
    for set in sets {
        let at = At {
            arms,
            readings: &set.readings,
            state,
        };
        let robot = set.tool().robot;
        let target = set.tool().target.clone().map(|name| (robot, name));
        for row in 0..set.len() {
            let (seen, pose) = match set.kind.seen(at.values(row)) {
                Some(Seen::Position(seen)) => (seen, None),
                Some(Seen::Pose(pose)) => (pose.translation, Some(pose)),
                None => continue,
            };
            all.push(Reading {
                seen,
                pose,
                tool: at.flange(0, row),
                target: target.clone(),
            });
        }
    }
    all
}

/// Registers a sensor frame S together with the tool points it sees that are not known yet.
///
/// S·seen = O + R·t is linear in (S's rotation as nine numbers, its translation, the points t): that
/// gives a start which needs no guess, and alternating between the frame (closed form) and the
/// points (means) refines it. Where the linear system is poorly conditioned the tool origin serves
/// as the first guess of the points; whichever fits better is taken.
pub fn register(arms: &[Arm], sets: &[&MeasurementSet], name: &str, state: &mut State) {
    let readings = readings(arms, sets, state);
    if register_bodies(&readings, sets, name, state) {
        return;
    }
    let named: BTreeSet<(usize, String)> =
        readings.iter().filter_map(|r| r.target.clone()).collect();
    let mut given = Targets::new();
    for (robot, name) in &named {
        if let Some(point) = state.target(*robot, name) {
            given.insert((*robot, name.clone()), point);
        }
    }
    let unknown: Vec<(usize, String)> = named
        .into_iter()
        .filter(|key| !given.contains_key(key))
        .collect();
    let known = |targets: &Targets, r: &Reading| match &r.target {
        Some(key) => targets.get(key).copied().unwrap_or_default(),
        None => Vector3::zeros(),
    };
    let refine = |mut targets: Targets| {
        let seen: Vec<Vector3<f64>> = readings.iter().map(|r| r.seen).collect();
        let mut sensor = Pose::identity();
        for _ in 0..50 {
            let tips: Vec<Vector3<f64>> = readings
                .iter()
                .map(|r| r.tool.apply(&known(&targets, r)))
                .collect();
            sensor = rigid_registration(&seen, &tips);
            for key in &unknown {
                let local: Vec<Vector3<f64>> = readings
                    .iter()
                    .filter(|r| r.target.as_ref() == Some(key))
                    .map(|r| r.tool.inverse().apply(&sensor.apply(&r.seen)))
                    .collect();
                targets.insert(key.clone(), mean(&local));
            }
            if unknown.is_empty() {
                break;
            }
        }
        let error: f64 = readings
            .iter()
            .map(|r| (r.tool.apply(&known(&targets, r)) - sensor.apply(&r.seen)).norm_squared())
            .sum();
        (error, sensor, targets)
    };
    let mut candidates = vec![refine(given.clone())];
    if !unknown.is_empty()
        && let Some(linear) = linear_targets(&readings, &unknown, &given)
    {
        candidates.push(refine(linear));
    }
    if let Some((_, sensor, targets)) = candidates.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)) {
        state.set_frame(name, sensor);
        for (robot, name) in &unknown {
            state.set_target(*robot, name, targets[&(*robot, name.clone())]);
        }
    }
}

/// The readings of a target's pose beside the poses of the tool.
fn pairs(readings: &[Reading], key: &(usize, String)) -> Vec<Pair> {
    let own = readings.iter().filter(|r| r.target.as_ref() == Some(key));
    own.filter_map(|r| Some((r.tool, r.pose?))).collect()
}

/// Registers a sensor frame by the bodies whose poses it sees, if there are any, and the bodies that are not known
/// yet; tool points follow once the frame is known.
///
/// Each body alone would give the frame, by the closed form of A X = S B (or by the mean, if the body is known);
/// the one that all bodies then fit best is taken. Where tools turn about one axis only a body is taken for
/// the tool itself: what that leaves undetermined is decided upon later.
fn register_bodies(
    readings: &[Reading],
    sets: &[&MeasurementSet],
    name: &str,
    state: &mut State,
) -> bool {
    let bodies: BTreeSet<(usize, String)> = sets
        .iter()
        .filter(|set| set.kind.targets() == TargetKind::Body)
        .flat_map(|set| set.targets())
        .collect();
    let mut best: Option<(f64, Pose<f64>, Vec<Pose<f64>>)> = None;
    for (robot, body) in &bodies {
        let own = pairs(readings, &(*robot, body.clone()));
        let sensor = match state.body(*robot, body) {
            Some(known) => sensor_of(&known, &own),
            None => match hand_eye(&own) {
                Some((sensor, _)) => sensor,
                None => sensor_of(&Pose::identity(), &own),
            },
        };
        let mut error = 0.0;
        let mut mounted = Vec::new();
        for (robot, body) in &bodies {
            let all = pairs(readings, &(*robot, body.clone()));
            let known = state.body(*robot, body);
            let x = known.unwrap_or_else(|| body_seen(&sensor, &all));
            for (a, b) in &all {
                let (placed, seen) = (a.compose(&x), sensor.compose(b));
                error += (placed.translation - seen.translation).norm_squared();
            }
            mounted.push(x);
        }
        if best.as_ref().is_none_or(|(least, ..)| error < *least) {
            best = Some((error, sensor, mounted));
        }
    }
    let Some((_, sensor, mounted)) = best else {
        return false;
    };
    state.set_frame(name, sensor);
    for ((robot, body), x) in bodies.into_iter().zip(mounted) {
        state.set(Key::Target(robot, body), Value::of::<Pose3>(x));
    }
    true
}

/// The tool points from the linear system A·seen + s − R·t = O, if it determines them.
fn linear_targets(
    readings: &[Reading],
    unknown: &[(usize, String)],
    known: &Targets,
) -> Option<Targets> {
    let n = 12 + 3 * unknown.len();
    if 3 * readings.len() < n + 6 {
        return None;
    }
    let mut a = DMatrix::<f64>::zeros(3 * readings.len(), n);
    let mut b = DVector::<f64>::zeros(3 * readings.len());
    for (k, r) in readings.iter().enumerate() {
        let mut right = r.tool.translation;
        for i in 0..3 {
            for c in 0..3 {
                a[(3 * k + i, 3 * i + c)] = r.seen[c];
            }
            a[(3 * k + i, 9 + i)] = 1.0;
        }
        match r
            .target
            .as_ref()
            .map(|key| (key, unknown.iter().position(|u| u == key)))
        {
            Some((_, Some(u))) => {
                for i in 0..3 {
                    for c in 0..3 {
                        a[(3 * k + i, 12 + 3 * u + c)] = -r.tool.rotation[(i, c)];
                    }
                }
            }
            Some((key, None)) => {
                right += r.tool.rotation * known.get(key).copied().unwrap_or_default()
            }
            None => {}
        }
        for i in 0..3 {
            b[3 * k + i] = right[i];
        }
    }
    let svd = a.svd(true, true);
    let largest = svd.singular_values.max();
    if svd.singular_values.min() < 1e-6 * largest {
        return None;
    }
    let x = svd.solve(&b, 0.0).ok()?;
    let mut targets = known.clone();
    for (u, key) in unknown.iter().enumerate() {
        targets.insert(
            key.clone(),
            Vector3::new(x[12 + 3 * u], x[13 + 3 * u], x[14 + 3 * u]),
        );
    }
    Some(targets)
}

/// A target seen in known frames: the mean of where the readings put it in the tool frame. One that is
/// only touched with starts at the tool origin.
pub fn locate_target(arms: &[Arm], sets: &[MeasurementSet], key: &Key, state: &State) -> Value {
    let Key::Target(robot, name) = key else {
        return Value::of::<Point3>(Vector3::zeros());
    };
    let names = |set: &&MeasurementSet| {
        set.tool().robot == *robot && set.tool().target.as_ref() == Some(name)
    };
    let (mut local, mut poses) = (Vec::new(), Vec::new());
    let mut body = false;
    for set in sets.iter().filter(names) {
        body |= set.kind.targets() == TargetKind::Body;
        let at = At {
            arms,
            readings: &set.readings,
            state,
        };
        let sensor = at.sensor();
        for r in readings(arms, &[set], state) {
            local.push(r.tool.inverse().apply(&sensor.apply(&r.seen)));
            poses.extend(r.pose.map(|pose| (r.tool, sensor.compose(&pose))));
        }
    }
    if body {
        Value::of::<Pose3>(body_seen(&Pose::identity(), &poses))
    } else {
        Value::of::<Point3>(mean(&local))
    }
}
