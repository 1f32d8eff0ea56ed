//! A kind of measurement of one's own: the length of a wire between the tool and a fixed anchor.
//!
//! A draw-wire sensor is cheap and measures one length a posture. Nobody knows exactly where it is
//! fixed, so its anchor is estimated too. Together with a few measured positions, which tie the robot
//! to its reference frame, it gives the offsets of the joints.
//! Run it: `cargo run --example custom_constraint`

use std::error::Error;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use truing::manifold::{Point3, Pose, Pose3, Vector};
use truing::nalgebra::Vector3;
use truing::{Batch, Constraint, Covariance, Noise, Problem, Scalar, Settings, Views, solve};
use truing_robot::Robot;
use truing_robot::kinds::Position;
use truing_robot::robot::Chain;
use truing_robot::robot::RobotFile;

const ROBOT: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../examples/puma560/puma560.toml"
);

// ANCHOR: constraint
// 1. What a measurement holds, which variables it is about (the robot's parameters and the anchor),
//    how many rows it has, and its residual: r = ‖tip − anchor‖ − length [m]. That is all.
struct DrawWire {
    chain: Arc<Chain>,
    q: Vec<f64>,
    length: f64,
}

impl Constraint for DrawWire {
    type Vars = (Vector, Point3);
    const DIM: usize = 1;

    fn residual<T: Scalar>(&self, (robot, anchor): Views<'_, Self, T>, r: &mut [T]) {
        let tip = self.chain.robot.forward(robot, &self.q).translation;
        let wire = tip - anchor;
        r[0] = wire.dot(&wire).sqrt() - self.length;
    }
}
// ANCHOR_END: constraint

/// What came out: for every joint its name, the true error of its offset, and the estimate with its
/// standard deviation [rad].
pub type Offsets = Vec<(String, f64, f64, f64)>;

/// Postures that move every joint, spread over its range.
fn posture(robot: &Robot, k: usize) -> Vec<f64> {
    let spread = |(j, joint): (usize, &truing_robot::robot::Joint)| {
        let [lower, upper] = joint.limits.unwrap_or([-1.0, 1.0]);
        // Multiples of square roots of primes never repeat.
        let prime = [2.0_f64, 3.0, 5.0, 7.0, 11.0, 13.0][j];
        lower + (upper - lower) * (0.25 + 0.5 * (k as f64 * prime.sqrt()).fract())
    };
    robot.joints().iter().enumerate().map(spread).collect()
}

/// Simulates measurements, estimates the offsets and prints them.
pub fn run(out: &mut dyn Write) -> Result<Offsets, Box<dyn Error>> {
    let chain = Chain::new(Robot::new(&RobotFile::read(Path::new(ROBOT))?));
    let robot = &chain.robot;

    // 2. The true robot: every joint offset is wrong by up to a degree, as after an exchange of motors.
    let joints = robot.joints().iter();
    let offsets: Vec<usize> = joints.filter_map(|j| j.offset_parameter).collect();
    let mut truth = robot.nominal();
    for (k, parameter) in offsets.iter().enumerate() {
        truth[*parameter] += [8e-3, -15e-3, 12e-3, -6e-3, 14e-3, -9e-3][k];
    }
    let true_anchor = Vector3::new(1.2, -0.4, 0.1);

    // ANCHOR: problem
    // 3. The variables. The tracker defines the reference frame and looks at the tool origin: both
    //    are fixed. Of the robot only the offsets of the joints are free.
    let mut problem = Problem::new();
    let parameters = problem.add_variable::<Vector>("robot", &robot.nominal());
    let tracker = problem.add_variable::<Pose3>("tracker", &Pose::identity());
    let tool = problem.add_variable::<Point3>("tool origin", &Vector3::zeros());
    let anchor = problem.add_variable::<Point3>("anchor", &Vector3::new(1.0, -0.5, 0.0));
    problem.fix(tracker);
    problem.fix(tool);
    for k in 0..robot.parameters().len() {
        if !offsets.contains(&k) {
            problem.fix_component(parameters, k);
        }
    }

    // 4. Two kinds of constraints in one problem, each with its own noise.
    let mut positions = Batch::new("positions").noise(Noise::isotropic(1e-4)?);
    let mut wires = Batch::new("wires").noise(Noise::isotropic(2e-4)?);
    for k in 0..60 {
        let q = posture(robot, k);
        let tip = robot.forward(&truth, &q).translation;
        if k < 3 {
            let (chain, q, measured) = (chain.clone(), q.clone(), tip);
            positions.push((parameters, tracker, tool), Position { chain, q, measured });
        }
        let length = (tip - true_anchor).norm() + noise(k);
        let chain = chain.clone();
        wires.push((parameters, anchor), DrawWire { chain, q, length });
    }
    problem.add_block(positions);
    problem.add_block(wires);

    // 5. Solve, and ask how sure the result is.
    let solution = solve(&problem, &Settings::default())?;
    let covariance = Covariance::at(&problem, &solution.values)?;
    // ANCHOR_END: problem

    write!(out, "{solution}")?;
    let estimate = solution.values.get(parameters);
    let sigmas = covariance.std_devs(parameters);
    let mut result = Vec::new();
    for k in offsets {
        let p = &robot.parameters()[k];
        let (true_error, found) = (truth[k] - p.nominal, estimate[k] - p.nominal);
        writeln!(
            out,
            "{}: {:+.2} ± {:.2} mrad, true {:+.2}",
            p.name,
            found * 1e3,
            sigmas[k] * 1e3,
            true_error * 1e3
        )?;
        result.push((p.name.clone(), true_error, found, sigmas[k]));
    }
    let p = solution.values.get(anchor);
    writeln!(out, "anchor at ({:.4}, {:.4}, {:.4}) m", p.x, p.y, p.z)?;
    Ok(result)
}

/// Errors of the wire lengths, within ±0.3 mm [m].
fn noise(k: usize) -> f64 {
    3e-4 * (2.0 * (k as f64 * 17_f64.sqrt()).fract() - 1.0)
}

fn main() -> Result<(), Box<dyn Error>> {
    run(&mut std::io::stdout())?;
    Ok(())
}
