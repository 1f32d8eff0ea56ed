//! Calibrates one robot from three kinds of measurements at once, from Rust.
//!
//! The same as `truing calibrate examples/puma560/calibration.toml`.
//! Run it: `cargo run --example mixed_constraints`

use std::error::Error;
use std::io::Write;
use std::path::Path;
use truing::nalgebra::Vector3;
use truing_robot::Robot;
use truing_robot::identify::Status;
use truing_robot::result::CalibrationResult;
use truing_robot::robot::RobotFile;
use truing_robot::text::{Dimension, Table, Units};
use truing_robot::{Calibration, kinds};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/puma560");

/// Columns of a data file as rows of numbers [rad] or [m].
fn read(
    table: &Table,
    names: &[&str],
    dimension: Dimension,
) -> Result<Vec<Vec<f64>>, Box<dyn Error>> {
    let rows: Vec<usize> = (0..table.len()).collect();
    let mut out = vec![Vec::new(); table.len()];
    for name in names {
        let column = table.numbers(name, dimension, &Units::SI, &rows)?;
        out.iter_mut().zip(column).for_each(|(row, x)| row.push(x));
    }
    Ok(out)
}

/// Calibrates the robot and prints errors and parameters.
pub fn run(out: &mut dyn Write) -> Result<CalibrationResult, Box<dyn Error>> {
    let folder = Path::new(FOLDER);
    // ANCHOR: robot
    // 1. The nominal robot comes from its file.
    let robot = Robot::new(&RobotFile::read(folder.join("puma560.toml"))?);
    let names: Vec<String> = robot.joints().iter().map(|j| j.name.clone()).collect();
    let joints: Vec<&str> = names.iter().map(String::as_str).collect();
    // ANCHOR_END: robot

    // ANCHOR: sets
    // 2. A set is joint values and what was measured there. Positions of a reflector, in the frame
    //    of a tracker: both the reflector on the tool and the tracker's pose are estimated.
    let table = Table::read(folder.join("data/tracker.csv"))?;
    let positions: Vec<Vector3<f64>> = read(&table, &["x", "y", "z"], Dimension::Length)?
        .iter()
        .map(|p| Vector3::new(p[0], p[1], p[2]))
        .collect();
    let q = read(&table, &joints, Dimension::Angle)?;
    let tracker = kinds::position("tracker", q, &positions)
        .sigma(&[5e-5])
        .frame("tracker")
        .target("reflector");

    // 3. Touches of a plane nobody measured: the joint values are all there is.
    let table = Table::read(folder.join("data/touches.csv"))?;
    let q = read(&table, &joints, Dimension::Angle)?;
    let one_plane = vec!["table"; q.len()];
    let touches = kinds::unknown_plane("touches", q, one_plane).sigma(&[5e-5]);

    // 4. The same points, reached in different postures: rows with one label share a point.
    let table = Table::read(folder.join("data/cones.csv"))?;
    let rows: Vec<usize> = (0..table.len()).collect();
    let points = table.strings("point", &rows)?;
    let q = read(&table, &joints, Dimension::Angle)?;
    let cones = kinds::same_point("cones", q, points).sigma(&[5e-5]);
    // ANCHOR_END: sets

    // ANCHOR: run
    // 5. One calibration takes them all. It finds its own starting values for the tracker, the
    //    reflector, the plane and the points, and estimates what the data can identify.
    let calibration = Calibration::of(robot)
        .measured(tracker)
        .measured(touches)
        .measured(cones)
        .fixing(&["gains"]);
    let result = calibration.calibrate()?.result;
    // ANCHOR_END: run

    // ANCHOR: print
    // 6. The result is plain data.
    writeln!(out, "{}", result.termination.message)?;
    for set in &result.constraints {
        if let (Some(registered), Some(after)) = (&set.registered, &set.after) {
            writeln!(
                out,
                "{:8} {:3} × {:13} rms {:.3} → {:.3} mm",
                set.name,
                set.count,
                set.kind,
                registered.rms * 1e3,
                after.rms * 1e3
            )?;
        }
    }
    for p in &result.parameters {
        if let (Status::Estimated, Some(sigma)) = (&p.status, p.sigma) {
            let (factor, unit) = match p.unit {
                "m" => (1e3, "mm"),
                _ => (1e3, "mrad"),
            };
            let change = (p.estimate - p.nominal) * factor;
            writeln!(
                out,
                "{:7} {change:+8.3} ± {:.3} {unit}",
                p.name,
                sigma * factor
            )?;
        }
    }
    // ANCHOR_END: print
    Ok(result)
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&mut std::io::stdout())?;
    Ok(())
}
