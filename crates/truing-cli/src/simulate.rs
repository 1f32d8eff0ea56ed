//! `truing simulate`.

use crate::args::Simulate;
use crate::failure::{Failure, Files};
use crate::output;
use crate::streams::{Ending, Streams};
use std::path::PathBuf;
use truing_robot::file::SimulationFile;
use truing_robot::simulate::{Simulated, simulate_with};
use truing_robot::unknown::{Key, Shape};

/// Runs a simulation file.
pub fn run(arguments: &Simulate, streams: &Streams) -> Result<Ending, Failure> {
    output::check(&arguments.output, arguments.force)?;
    let file = SimulationFile::read_with(&arguments.file, &streams.registry)?;
    let simulated = simulate_with(&file, arguments.seed, &streams.registry)?;
    let seed = arguments.seed.unwrap_or(file.seed);
    let robots = simulated.true_robots();
    let named = |stem: &str, name: &str| {
        if name.is_empty() {
            format!("{stem}.toml")
        } else {
            format!("{stem}-{name}.toml")
        }
    };
    let mut files: Files = Vec::new();
    let mut nominal = Vec::new();
    for (arm, (name, truth)) in simulated.arms.iter().zip(robots) {
        let made = format!("seed {seed} of {}", file_name(&arguments.file));
        let file = named("robot", &name);
        let given = arm.robot.with_parameters(&arm.robot.nominal());
        files.push((
            PathBuf::from(&file),
            given.to_toml(&format!("Nominal robot of simulation {made}.")),
        ));
        files.push((
            PathBuf::from(named("true-robot", &name)),
            truth.to_toml(&format!("True robot of simulation {made}.")),
        ));
        nominal.push(file);
    }
    for (k, name) in simulated.files.iter().enumerate() {
        files.push((PathBuf::from(name), simulated.csv(k)));
    }
    files.push((
        PathBuf::from("calibration.toml"),
        simulated.calibration_toml(&nominal),
    ));
    let truth = serde_json::to_string_pretty(&truth(&simulated)).map_err(|e| {
        Failure::new(
            format!("cannot write the truth as JSON: {e}"),
            "report this with the simulation file",
        )
    })?;
    files.push((PathBuf::from("truth.json"), truth.clone() + "\n"));
    check_names(&files, &arguments.file)?;
    let written = output::write(&arguments.output, &files)?;
    for set in &simulated.sets {
        streams.say(&format!(
            "{}: {} measurements of kind {}\n",
            set.name,
            set.len(),
            set.kind.name()
        ));
    }
    for path in written {
        streams.say(&format!("wrote {}\n", path.display()));
    }
    if streams.json {
        streams.print(&(truth + "\n"));
    }
    Ok(Ending::Good)
}

fn file_name(path: &std::path::Path) -> String {
    path.file_name().map_or_else(
        || path.display().to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}

/// Data files must not take the names of the other files.
fn check_names(files: &Files, source: &std::path::Path) -> Result<(), Failure> {
    for (k, (path, _)) in files.iter().enumerate() {
        if files[..k].iter().any(|(other, _)| other == path) {
            return Err(Failure::new(
                format!(
                    "{}: `{}` is also written by the simulation itself",
                    source.display(),
                    path.display()
                ),
                "give the data file another name",
            ));
        }
    }
    Ok(())
}

/// Everything that was simulated, as it truly is.
fn truth(simulated: &Simulated) -> serde_json::Value {
    let truth = &simulated.truth;
    let mut parameters = serde_json::Map::new();
    for (arm, values) in simulated.arms.iter().zip(&truth.robots) {
        for (k, value) in values.iter().enumerate() {
            parameters.insert(arm.parameter_name(k), (*value).into());
        }
    }
    let (mut planes, mut points, mut locations) = (Vec::new(), Vec::new(), Vec::new());
    let mut numbers = Vec::new();
    for set in &simulated.sets {
        for group in &set.groups.names {
            for unknown in set.kind.unknowns() {
                let Some(value) = truth.own(&set.name, group, unknown.name) else {
                    continue;
                };
                let mut about = serde_json::json!({ "constraint": set.name, "group": group });
                match value.shape() {
                    Shape::Plane(plane) => {
                        about["normal"] = plane.normal.as_slice().into();
                        about["distance"] = plane.distance.into();
                        planes.push(about);
                    }
                    Shape::Point(point) => {
                        about["position"] = point.as_slice().into();
                        points.push(about);
                    }
                    Shape::Pose(location) => {
                        about["position"] = location.translation.as_slice().into();
                        about["quaternion"] = location.quaternion().into();
                        locations.push(about);
                    }
                    // What is known stands in the calibration file.
                    Shape::Numbers(_) if unknown.known => {}
                    Shape::Numbers(values) => {
                        about["name"] = unknown.name.into();
                        about["values"] = values.into();
                        numbers.push(about);
                    }
                }
            }
        }
    }
    let (mut frames, mut targets) = (Vec::new(), Vec::new());
    for (key, value) in truth.iter() {
        let shape = value.shape();
        match (key, &shape) {
            (Key::Frame(name), Shape::Pose(pose)) => frames.push(serde_json::json!({
                "name": name, "position": pose.translation.as_slice(), "quaternion": pose.quaternion(),
            })),
            (Key::Target(robot, name), Shape::Point(point)) => targets.push(serde_json::json!({
                "name": name, "robot": simulated.arms[*robot].name, "position": point.as_slice(),
            })),
            (Key::Target(robot, name), Shape::Pose(pose)) => targets.push(serde_json::json!({
                "name": name, "robot": simulated.arms[*robot].name,
                "position": pose.translation.as_slice(), "quaternion": pose.quaternion(),
            })),
            _ => {}
        }
    }
    let mut truth = serde_json::json!({
        "parameters": parameters, "frames": frames, "targets": targets, "planes": planes, "points": points,
    });
    if !locations.is_empty() {
        truth["locations"] = locations.into();
    }
    if !numbers.is_empty() {
        truth["unknowns"] = numbers.into();
    }
    truth
}
