//! From a simulation file to data: true robots, planes and points, and measurements of them.

use super::sample::{Sampling, sample};
use crate::calibration::{
    Arm, Groups, Measured, MeasurementSet, Names, Sigma, State, in_unit_of, read_arms,
};
use crate::error::Error;
use crate::file::{
    ErrorSpec, InputError, Kind, PlacesSpec, PlaneSpec, RobotFile, SigmaSpec, SimulationFile,
    SimulationSpec, Source,
};
use crate::kinematics::{Robot, Unit};
use crate::posture;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{StandardNormal, StandardUniform};
use std::fmt::Write;
use truing::manifold::{Plane, Pose};
use truing::nalgebra::Vector3;

/// Simulated data, ready to be written.
#[derive(Debug, Clone)]
pub struct Simulated {
    /// The nominal robots.
    pub arms: Vec<Arm>,
    /// Robots, planes, points, frames and tool points as they truly are.
    pub truth: State,
    /// The measurements.
    pub sets: Vec<MeasurementSet>,
    /// Names of the data files, one a set.
    pub files: Vec<String>,
}

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
    let arms = read_arms(&file.robots, &file.source)?;
    let seed = seed.unwrap_or(file.seed);
    let mut truth = State {
        robots: true_robots(file, &arms, seed)?,
        ..State::default()
    };
    let (mut sets, mut files) = (Vec::new(), Vec::new());
    for (k, spec) in file.constraints.iter().enumerate() {
        // Each constraint draws from a stream of its own: adding one leaves the others as they were.
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(k as u64 + 1);
        let template = template(&file.source, &arms, spec, &mut truth, &mut rng)?;
        let sampling = Sampling {
            count: spec.count,
            noise: Some(noise(spec)),
            near: None,
        };
        let set = sample(&arms, k, &template, &truth, &sampling, &mut rng);
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

/// The noise that a constraint asks for.
pub(crate) fn noise(spec: &SimulationSpec) -> Sigma {
    match spec.sigma {
        None => Sigma {
            position: 0.0,
            rotation: 0.0,
        },
        Some(SigmaSpec::Single(quantity)) => Sigma {
            position: quantity.value,
            rotation: if quantity.dimension.is_none() {
                quantity.value
            } else {
                0.0
            },
        },
        Some(SigmaSpec::Pose { position, rotation }) => Sigma { position, rotation },
    }
}

/// A set without rows, and its frame, tool point, planes, points and distance put into the truth.
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
    let target = Vector3::from(spec.target_position);
    if let Some(name) = &spec.target {
        let key = (robot, name.value.clone());
        let known = truth.targets.insert(key, target);
        differ(
            source,
            spec,
            "target_position",
            known.is_some_and(|known| known != target),
        )?;
    } else if spec.target_position != [0.0; 3] {
        return Err(source
            .error_at(
                spec.spans.of("target_position"),
                "the tool point has no name",
            )
            .with_help("name it: target = \"s1\"")
            .into());
    }
    if let Some(name) = &spec.frame {
        let [x, y, z, qw, qx, qy, qz] = spec.frame_pose;
        let pose = Pose::from_quaternion(Vector3::new(x, y, z), [qw, qx, qy, qz]);
        let known = truth.frames.insert(name.value.clone(), pose);
        differ(
            source,
            spec,
            "frame_pose",
            known.is_some_and(|known| known != pose),
        )?;
    }
    let arm = &arms[robot];
    let mut somewhere = || {
        let q = if spec.kind == Kind::SameLocation {
            posture::dexterous(&arm.robot, &truth.robots[robot], rng)
        } else {
            posture::random(&posture::limits(&arm.robot), rng)
        };
        let target = if spec.target.is_some() {
            target
        } else {
            Vector3::zeros()
        };
        let tool = arm.robot.forward(&truth.robots[robot], &q);
        let location = Pose {
            translation: tool.apply(&target),
            rotation: tool.rotation,
        };
        let direction: Vector3<f64> = Vector3::from_fn(|_, _| rng.sample(StandardNormal));
        (location, direction)
    };
    let drawn = |(location, direction): (Pose<f64>, Vector3<f64>)| {
        let normal = direction.try_normalize(1e-12).unwrap_or_else(Vector3::z);
        let through = normal.dot(&location.translation);
        Plane {
            normal,
            // Of the two planes at a distance, the one on the side of what is within reach.
            distance: spec
                .plane_distance
                .map_or(through, |distance| distance.copysign(through)),
        }
    };
    let given = |plane: PlaneSpec| {
        let (normal, distance) = plane.normalised();
        Plane {
            normal: normal.into(),
            distance,
        }
    };
    let (mut planes, mut points, mut locations) = (Vec::new(), Vec::new(), Vec::new());
    let labels = |n: usize| (1..=n).map(|k| k.to_string()).collect::<Vec<_>>();
    let measured = match spec.kind {
        Kind::Position => Measured::Position(Vec::new()),
        Kind::Pose => Measured::Pose(Vec::new()),
        Kind::KnownPlane => Measured::KnownPlane(match spec.plane {
            Some(plane) => given(plane),
            None => drawn(somewhere()),
        }),
        Kind::UnknownPlane => {
            planes = match &spec.planes {
                PlacesSpec::Random(n) => (0..*n).map(|_| drawn(somewhere())).collect(),
                PlacesSpec::Listed(listed) => listed.iter().copied().map(given).collect(),
            };
            Measured::UnknownPlane(Groups {
                names: labels(planes.len()),
                of_row: Vec::new(),
            })
        }
        Kind::SamePoint => {
            points = match &spec.points {
                PlacesSpec::Random(n) => (0..*n).map(|_| somewhere().0.translation).collect(),
                PlacesSpec::Listed(listed) => listed.iter().map(|p| Vector3::from(*p)).collect(),
            };
            Measured::SamePoint(Groups {
                names: labels(points.len()),
                of_row: Vec::new(),
            })
        }
        Kind::SameLocation => {
            locations = match &spec.locations {
                PlacesSpec::Random(n) => (0..*n).map(|_| somewhere().0).collect(),
                PlacesSpec::Listed(listed) => listed
                    .iter()
                    .map(|[x, y, z, qw, qx, qy, qz]| {
                        Pose::from_quaternion(Vector3::new(*x, *y, *z), [*qw, *qx, *qy, *qz])
                    })
                    .collect(),
            };
            Measured::SameLocation(Groups {
                names: labels(locations.len()),
                of_row: Vec::new(),
            })
        }
        Kind::Distance => Measured::Distance {
            other: spec
                .robots
                .as_ref()
                .map(|names| number(Some(names[1].value.as_str()))),
            q_b: Vec::new(),
            distance: Some(spec.distance),
        },
    };
    truth.planes.push(planes);
    truth.points.push(points);
    truth.locations.push(locations);
    truth.distances.push(spec.distance);
    let mut set = MeasurementSet::new(&spec.name, robot, Vec::new(), measured);
    set.target = spec.target.as_ref().map(|t| t.value.clone());
    set.frame = spec.frame.as_ref().map(|f| f.value.clone());
    Ok(set)
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

impl Simulated {
    /// The true robots, with their names in the simulation.
    pub fn true_robots(&self) -> Vec<(String, RobotFile)> {
        self.arms
            .iter()
            .zip(&self.truth.robots)
            .map(|(arm, values)| (arm.name.clone(), arm.robot.with_parameters(values)))
            .collect()
    }

    /// Set number `k` as CSV: joint columns, what was measured, groups; metres and radians.
    pub fn csv(&self, k: usize) -> String {
        let set = &self.sets[k];
        let joints = |robot: usize| {
            self.arms[robot]
                .robot
                .joints()
                .iter()
                .map(|j| j.name.clone())
        };
        let prefixed = |robot: usize, suffix: &str| -> Vec<String> {
            let arm = &self.arms[robot].name;
            joints(robot)
                .map(|name| {
                    if arm.is_empty() {
                        format!("{name}{suffix}")
                    } else {
                        format!("{arm}.{name}{suffix}")
                    }
                })
                .collect()
        };
        let mut header = prefixed(set.robot, "");
        match &set.measured {
            Measured::Distance { other: Some(b), .. } => header.extend(prefixed(*b, "")),
            Measured::Distance { other: None, .. } => header.extend(prefixed(set.robot, "b")),
            _ => {}
        }
        let columns: &[&str] = match &set.measured {
            Measured::Position(_) => &["x", "y", "z"],
            Measured::Pose(_) => &["x", "y", "z", "qw", "qx", "qy", "qz"],
            Measured::UnknownPlane(_) => &["plane"],
            Measured::SamePoint(_) => &["point"],
            Measured::SameLocation(_) => &["location"],
            _ => &[],
        };
        header.extend(columns.iter().map(|c| (*c).to_owned()));
        let mut text = header.join(",") + "\n";
        for row in 0..set.len() {
            let mut cells: Vec<String> = set.q[row].iter().map(f64::to_string).collect();
            match &set.measured {
                Measured::Position(points) => cells.extend(points[row].iter().map(f64::to_string)),
                Measured::Pose(poses) => {
                    cells.extend(poses[row].translation.iter().map(f64::to_string));
                    cells.extend(poses[row].quaternion().iter().map(f64::to_string));
                }
                Measured::UnknownPlane(groups)
                | Measured::SamePoint(groups)
                | Measured::SameLocation(groups) => {
                    cells.push(groups.names[groups.of_row[row]].clone());
                }
                Measured::Distance { q_b, .. } => cells.extend(q_b[row].iter().map(f64::to_string)),
                Measured::KnownPlane(_) => {}
            }
            text += &(cells.join(",") + "\n");
        }
        text
    }

    /// A calibration file that reads the data, with the robots under `robot_files`.
    pub fn calibration_toml(&self, robot_files: &[String]) -> String {
        let quoted = |text: &str| format!("{text:?}");
        let mut out = String::new();
        for (arm, file) in self.arms.iter().zip(robot_files) {
            let title = if arm.name.is_empty() {
                "robot".to_owned()
            } else {
                format!("robots.{}", arm.name)
            };
            let _ = writeln!(out, "[{title}]\nfile = {}\n", quoted(file));
        }
        out.push_str("[estimate]\nparameters = [\"all\"]\n");
        for (set, data) in self.sets.iter().zip(&self.files) {
            let _ = writeln!(out, "\n[[constraint]]\nname = {}", quoted(&set.name));
            let _ = writeln!(
                out,
                "kind = \"{}\"\ndata = {}",
                set.measured.kind(),
                quoted(data)
            );
            let several = self.arms.len() > 1;
            match &set.measured {
                Measured::Distance { other: Some(b), .. } => {
                    let names = [
                        quoted(&self.arms[set.robot].name),
                        quoted(&self.arms[*b].name),
                    ];
                    let _ = writeln!(out, "robots = [{}]", names.join(", "));
                }
                _ if several => {
                    let _ = writeln!(out, "robot = {}", quoted(&self.arms[set.robot].name));
                }
                _ => {}
            }
            match &set.measured {
                Measured::KnownPlane(p) => {
                    let n = p.normal;
                    let _ = writeln!(
                        out,
                        "plane = {{ normal = [{:?}, {:?}, {:?}], distance = {:?} }}",
                        n.x, n.y, n.z, p.distance
                    );
                }
                Measured::Distance {
                    distance: Some(d), ..
                } => {
                    let _ = writeln!(out, "distance = {d:?}");
                }
                _ => {}
            }
            if let Some(sigma) = set.sigma.first() {
                let _ = match &set.measured {
                    Measured::Pose(_) | Measured::SameLocation(_) if sigma.rotation > 0.0 => {
                        writeln!(
                            out,
                            "sigma = {{ position = {:?}, rotation = {:?} }}",
                            sigma.position, sigma.rotation
                        )
                    }
                    _ => writeln!(out, "sigma = {:?}", sigma.position),
                };
            }
            for (key, value) in [("frame", &set.frame), ("target", &set.target)] {
                if let Some(value) = value {
                    let _ = writeln!(out, "{key} = {}", quoted(value));
                }
            }
        }
        out
    }
}
