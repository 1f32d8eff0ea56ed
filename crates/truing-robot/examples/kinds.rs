//! What each kind of measurement can identify of a robot, by itself.
//!
//! Simulates sixty measurements of every kind on the PUMA 560, calibrates from each kind alone and
//! prints which parameters were not estimated. Run it: `cargo run --example kinds`

use std::error::Error;
use std::io::Write;
use std::path::Path;
use truing_robot::Calibration;
use truing_robot::file::SimulationFile;
use truing_robot::identify::Status;
use truing_robot::result::ParameterResult;
use truing_robot::robot::ParameterKind;
use truing_robot::simulate::simulate;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/puma560");

/// One set of every kind; the robot is as its file says, the errors are those of the sensors.
const SIMULATION: &str = r#"
seed = 1
robot.file = "puma560.toml"

[[constraint]]
kind = "pose"
data = "pose.csv"
count = 60
sigma = { position = "0.05 mm", rotation = "0.05 mrad" }

[[constraint]]
kind = "position"
data = "position.csv"
count = 60
sigma = "0.05 mm"

[[constraint]]
kind = "known-plane"
data = "known-plane.csv"
plane = { normal = [0, 0, 1], distance = 0.35 }
count = 60
sigma = "0.05 mm"

[[constraint]]
kind = "unknown-plane"
data = "unknown-plane.csv"
planes = [{ normal = [0, 0, 1], distance = 0.35 }]
count = 60
sigma = "0.05 mm"

[[constraint]]
kind = "same-point"
data = "same-point.csv"
points = 3
count = 20
sigma = "0.05 mm"

[[constraint]]
kind = "distance"
data = "distance.csv"
distance = 0.5
count = 60
sigma = "0.05 mm"
"#;

/// For every kind: its name, and every parameter with what became of it.
pub type Kinds = Vec<(String, Vec<ParameterResult>)>;

/// Calibrates from every kind alone and prints what it did not identify.
pub fn run(out: &mut dyn Write) -> Result<Kinds, Box<dyn Error>> {
    // 1. Simulated measurements, without writing files.
    let path = Path::new(FOLDER).join("simulation.toml");
    let simulated = simulate(&SimulationFile::parse(SIMULATION, path)?, None)?;
    let robot = &simulated.arms[0].robot;

    let mut kinds = Vec::new();
    for set in simulated.sets {
        // 2. One kind alone; the gains are left as they are.
        let kind = set.kind.name().to_owned();
        let parameters = robot.parameters().iter();
        let all = parameters.filter(|p| p.kind != ParameterKind::Gain).count();
        let calibration = Calibration::new(simulated.arms.clone(), vec![set]).fixing(&["gains"]);
        let result = calibration.calibrate()?.result;

        // 3. What was not estimated, and why.
        let named = |status: Status| {
            let found = result.parameters.iter().filter(|p| p.status == status);
            found.map(|p| p.name.as_str()).collect::<Vec<_>>()
        };
        let estimated = named(Status::Estimated).len();
        write!(out, "{kind:13} {estimated} of {all};")?;
        for status in [
            Status::Regrouped,
            Status::Held,
            Status::NoEffect,
            Status::Unexcited,
        ] {
            let word = status.name();
            let names = named(status);
            if !names.is_empty() {
                write!(out, " {word}: {}", names.join(" "))?;
            }
        }
        writeln!(out)?;
        kinds.push((kind, result.parameters));
    }
    Ok(kinds)
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&mut std::io::stdout())?;
    Ok(())
}
