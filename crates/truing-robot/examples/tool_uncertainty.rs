//! How well the tool of a calibrated robot is known, where it was measured and where it was not.
//!
//! Run it: `cargo run --example tool_uncertainty`

use std::error::Error;
use std::io::Write;
use std::path::Path;
use truing_robot::file::CalibrationFile;
use truing_robot::judge::ToolPose;
use truing_robot::load::load;

const FILE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../examples/puma560/calibration.toml"
);

/// Calibrates the robot and prints how well its tool is known; returns the poses that it asked about.
pub fn run(out: &mut dyn Write) -> Result<Vec<ToolPose>, Box<dyn Error>> {
    // ANCHOR: calibrate
    // 1. A calibration, with what it says of its own certainty.
    let calibration = load(&CalibrationFile::read(Path::new(FILE))?)?;
    let outcome = calibration.run(&|_stage| {})?;
    let uncertainty = outcome.uncertainty.ok_or("unknowns cannot be told apart")?;
    for tool in &outcome.result.tools {
        writeln!(
            out,
            "over {} measurements: {:.3} mm, at most {:.3} mm",
            tool.count,
            tool.rms * 1e3,
            tool.worst * 1e3
        )?;
    }
    // ANCHOR_END: calibrate

    // ANCHOR: ask
    // 2. Any posture [rad]: where the tracker will see the reflector, and where the tool itself is in
    //    the frame that the robot file starts from.
    let mut poses = Vec::new();
    for q in [
        [0.5, -0.9, 0.6, 0.4, 0.7, 0.0],
        [2.6, -3.0, 2.5, 2.0, -1.5, 3.0],
    ] {
        for (what, target, frame) in [
            (
                "reflector, from the tracker",
                Some("reflector"),
                Some("tracker"),
            ),
            ("tool origin, from the base", None, None),
        ] {
            let tool = uncertainty.tool_pose(0, &q, target, frame)?;
            let p = tool.pose.translation * 1e3;
            writeln!(
                out,
                "{what}: ({:.2}, {:.2}, {:.2}) mm ± {:.3} mm, ± {:.4}°",
                p.x,
                p.y,
                p.z,
                tool.position_sigma() * 1e3,
                tool.rotation_sigma().to_degrees()
            )?;
            poses.push(tool);
        }
    }
    // ANCHOR_END: ask
    Ok(poses)
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&mut std::io::stdout())?;
    Ok(())
}
