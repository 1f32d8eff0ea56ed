//! Starting values nobody has to guess: sensor frames and tool points by registration, planes and
//! points by fitting, all with the nominal robot.

use super::measurement::{Arm, Measured, MeasurementSet};
use super::state::State;
use std::collections::{BTreeMap, BTreeSet};
use truing::manifold::{Plane, Pose};
use truing::nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// A state for the sets with the given robots: known frames and tool points are kept, missing ones
/// are registered, planes, points and distances are fitted.
pub fn start(arms: &[Arm], sets: &[MeasurementSet], robots: Vec<Vec<f64>>, known: &State) -> State {
    let mut state = State {
        robots,
        frames: known.frames.clone(),
        targets: known.targets.clone(),
        ..State::default()
    };
    for set in sets {
        if let (Some(name), Some(guess)) = (&set.target, set.target_guess) {
            state
                .targets
                .entry((set.robot, name.clone()))
                .or_insert(guess);
        }
        if let (Some(name), Some(guess)) = (&set.frame, set.frame_guess) {
            state.frames.entry(name.clone()).or_insert(guess);
        }
    }
    let frames: BTreeSet<&String> = sets.iter().filter_map(|set| set.frame.as_ref()).collect();
    for name in frames {
        if !state.frames.contains_key(name) {
            let members: Vec<&MeasurementSet> = sets
                .iter()
                .filter(|set| set.frame.as_ref() == Some(name))
                .collect();
            register(arms, &members, name, &mut state);
        }
    }
    for set in sets {
        for key in set.targets() {
            if !state.targets.contains_key(&key) {
                let target = locate_target(arms, sets, &key, &state);
                state.targets.insert(key, target);
            }
        }
    }
    fit_groups(arms, sets, &mut state);
    state
}

/// Fits planes, points and unknown distances to the tool points of a state.
pub fn fit_groups(arms: &[Arm], sets: &[MeasurementSet], state: &mut State) {
    let (mut planes, mut points) = (Vec::new(), Vec::new());
    let (mut locations, mut distances) = (Vec::new(), Vec::new());
    for set in sets {
        let tips = || {
            tips(
                &arms[set.robot],
                set,
                &state.robots[set.robot],
                &state.target(set),
            )
        };
        let (mut set_planes, mut set_points) = (Vec::new(), Vec::new());
        let (mut set_locations, mut distance) = (Vec::new(), 0.0);
        match &set.measured {
            Measured::UnknownPlane(groups) => {
                let tips = tips();
                for g in 0..groups.names.len() {
                    let touches = members(&tips, &groups.of_row, g);
                    let chart = set.form.as_ref().and_then(|form| form.chart());
                    set_planes.push(match chart {
                        Some(chart) => chart.fit(&touches),
                        None => best_fit_plane(&touches),
                    });
                }
            }
            Measured::SamePoint(groups) => {
                let tips = tips();
                for g in 0..groups.names.len() {
                    set_points.push(mean(&members(&tips, &groups.of_row, g)));
                }
            }
            Measured::SameLocation(groups) => {
                let tips = tips();
                for g in 0..groups.names.len() {
                    let visits = groups.of_row.iter().zip(&set.q).filter(|(h, _)| **h == g);
                    let rotations = visits.map(|(_, q)| {
                        let robot = &arms[set.robot].robot;
                        robot.forward(&state.robots[set.robot], q).rotation
                    });
                    set_locations.push(Pose {
                        rotation: nearest_rotation(&rotations.sum()),
                        translation: mean(&members(&tips, &groups.of_row, g)),
                    });
                }
            }
            Measured::Distance {
                distance: Some(known),
                ..
            } => distance = *known,
            Measured::Distance {
                other,
                q_b,
                distance: None,
            } => {
                let b = other.unwrap_or(set.robot);
                let target = state.second_target(set);
                let total: f64 = tips()
                    .iter()
                    .zip(q_b)
                    .map(|(a, q)| {
                        (a - arms[b].robot.forward(&state.robots[b], q).apply(&target)).norm()
                    })
                    .sum();
                distance = total / set.len().max(1) as f64;
            }
            _ => {}
        }
        planes.push(set_planes);
        points.push(set_points);
        locations.push(set_locations);
        distances.push(distance);
    }
    (state.planes, state.points) = (planes, points);
    (state.locations, state.distances) = (locations, distances);
}

/// Fits the planes, points and locations that the equations of some sets leave out.
pub(super) fn fit_eliminated(arms: &[Arm], sets: &[MeasurementSet], state: &mut State) {
    if !sets.iter().any(MeasurementSet::eliminates) {
        return;
    }
    let mut fitted = state.clone();
    fit_groups(arms, sets, &mut fitted);
    for (k, set) in sets.iter().enumerate() {
        if set.eliminates() {
            state.planes[k].clone_from(&fitted.planes[k]);
            state.points[k].clone_from(&fitted.points[k]);
            state.locations[k].clone_from(&fitted.locations[k]);
        }
    }
}

/// The tool points of a set in the reference frame \[m\].
pub fn tips(
    arm: &Arm,
    set: &MeasurementSet,
    parameters: &[f64],
    target: &Vector3<f64>,
) -> Vec<Vector3<f64>> {
    set.q
        .iter()
        .map(|q| arm.robot.forward(parameters, q).apply(target))
        .collect()
}

fn members(points: &[Vector3<f64>], of_row: &[usize], group: usize) -> Vec<Vector3<f64>> {
    points
        .iter()
        .zip(of_row)
        .filter(|(_, g)| **g == group)
        .map(|(p, _)| *p)
        .collect()
}

fn mean(points: &[Vector3<f64>]) -> Vector3<f64> {
    points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64
}

/// The plane with the least sum of squared distances: through the mean, across the direction of
/// least spread. Its normal points away from the origin. With fewer than three points, one of the
/// planes through them.
pub fn best_fit_plane(points: &[Vector3<f64>]) -> Plane<f64> {
    let center = mean(points);
    let scatter: Matrix3<f64> = points
        .iter()
        .map(|p| (p - center) * (p - center).transpose())
        .sum();
    let eigen = scatter.symmetric_eigen();
    let smallest = eigen.eigenvalues.imin();
    let mut normal: Vector3<f64> = eigen.eigenvectors.column(smallest).into_owned();
    let found = normal.norm() > 0.5;
    if !found {
        normal = Vector3::z();
    }
    if normal.dot(&center) < 0.0 {
        normal = -normal;
    }
    Plane {
        normal,
        distance: normal.dot(&center),
    }
}

/// The rigid motion with the least Σ‖to − motion(from)‖² (Arun, Huang & Blostein 1987).
pub fn rigid_registration(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Pose<f64> {
    let (from_center, to_center) = (mean(from), mean(to));
    let covariance: Matrix3<f64> = from
        .iter()
        .zip(to)
        .map(|(f, t)| (t - to_center) * (f - from_center).transpose())
        .sum();
    let rotation = nearest_rotation(&covariance);
    Pose {
        rotation,
        translation: to_center - rotation * from_center,
    }
}

/// The rotation nearest to a matrix: U · diag(1, 1, ±1) · Vᵀ of its singular value decomposition.
fn nearest_rotation(m: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = m.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Matrix3::identity();
    };
    let mut flip = Matrix3::identity();
    if (u * v_t).determinant() < 0.0 {
        flip[(2, 2)] = -1.0;
    }
    u * flip * v_t
}

/// One reading of a sensor: what it saw, with the tool pose of the nominal robot.
struct Reading {
    seen: Vector3<f64>,
    tool: Pose<f64>,
    target: Option<(usize, String)>,
}

fn readings(arms: &[Arm], sets: &[&MeasurementSet], robots: &[Vec<f64>]) -> Vec<Reading> {
    let mut all = Vec::new();
    for set in sets {
        let seen: Vec<Vector3<f64>> = match &set.measured {
            Measured::Position(points) => points.clone(),
            Measured::Pose(poses) => poses.iter().map(|pose| pose.translation).collect(),
            _ => continue,
        };
        let target = set.target.clone().map(|name| (set.robot, name));
        for (q, seen) in set.q.iter().zip(seen) {
            let tool = arms[set.robot].robot.forward(&robots[set.robot], q);
            all.push(Reading {
                seen,
                tool,
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
fn register(arms: &[Arm], sets: &[&MeasurementSet], name: &str, state: &mut State) {
    let readings = readings(arms, sets, &state.robots);
    let unknown: BTreeSet<(usize, String)> = readings
        .iter()
        .filter_map(|r| r.target.clone())
        .filter(|key| !state.targets.contains_key(key))
        .collect();
    let unknown: Vec<(usize, String)> = unknown.into_iter().collect();
    let known = |targets: &BTreeMap<(usize, String), Vector3<f64>>, r: &Reading| match &r.target {
        Some(key) => targets.get(key).copied().unwrap_or_default(),
        None => Vector3::zeros(),
    };
    let refine = |mut targets: BTreeMap<(usize, String), Vector3<f64>>| {
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
    let mut candidates = vec![refine(state.targets.clone())];
    if !unknown.is_empty()
        && let Some(linear) = linear_targets(&readings, &unknown, &state.targets)
    {
        candidates.push(refine(linear));
    }
    if let Some((_, sensor, targets)) = candidates.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)) {
        state.frames.insert(name.to_owned(), sensor);
        state.targets = targets;
    }
}

/// The tool points from the linear system A·seen + s − R·t = O, if it determines them.
fn linear_targets(
    readings: &[Reading],
    unknown: &[(usize, String)],
    known: &BTreeMap<(usize, String), Vector3<f64>>,
) -> Option<BTreeMap<(usize, String), Vector3<f64>>> {
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

/// A tool point seen in known frames: the mean of where the readings put it in the tool frame.
/// One that is only touched with starts at the tool origin.
fn locate_target(
    arms: &[Arm],
    sets: &[MeasurementSet],
    key: &(usize, String),
    state: &State,
) -> Vector3<f64> {
    let mut local = Vec::new();
    for set in sets
        .iter()
        .filter(|set| set.robot == key.0 && set.target.as_ref() == Some(&key.1))
    {
        let sensor = state.sensor(set);
        for r in readings(arms, &[set], &state.robots) {
            local.push(r.tool.inverse().apply(&sensor.apply(&r.seen)));
        }
    }
    mean(&local)
}
