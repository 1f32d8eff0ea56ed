//! Robots with models of joints and general frames stand where other formulae say that they do.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use truing::nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use truing_robot::Robot;
use truing_robot::robot::{DifferentiateChain, FrameWise, Regressor, RobotFile};

fn read(text: &str) -> Robot {
    Robot::new(&RobotFile::parse(text, "robot.toml").unwrap_or_else(|error| panic!("{error}")))
}

/// At its nominal parameters.
#[track_caller]
fn assert_stands_at(robot: &Robot, row: &[f64], expected: &Isometry3<f64>) {
    let found = robot.forward(&robot.nominal(), row);
    let turn = expected.rotation.to_rotation_matrix();
    let (place, turn) = (
        (found.translation - expected.translation.vector).norm(),
        (found.rotation - turn.matrix()).norm(),
    );
    assert!(place < 1e-13 && turn < 1e-13, "{place:.1e} m, {turn:.1e}");
}

fn postures(joints: usize) -> impl Iterator<Item = Vec<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(9);
    (0..50).map(move |_| {
        (0..joints)
            .map(|_| random.random_range(-3.0..3.0))
            .collect()
    })
}

/// The product that the URDF specification gives: origin (fixed-axis roll, pitch, yaw), then the joint.
#[test]
fn general_frames_are_a_urdf_chain() {
    let joints = [
        (
            [0.1, 0.2, 0.3],
            [0.4, -0.5, 0.6],
            [0.0, 0.0, 1.0],
            "revolute",
        ),
        (
            [-0.6, 0.0, 0.1],
            [1.5, 0.2, -3.0],
            [1.0, 2.0, -1.0],
            "revolute",
        ),
        (
            [0.0, 0.3, 0.0],
            [0.0, -0.7, 0.0],
            [0.0, -1.0, 0.0],
            "prismatic",
        ),
        ([0.2, 0.0, 0.4], [0.0, 0.0, 0.3], [0.0, 0.0, 1.0], "fixed"),
        (
            [0.0, 0.0, 0.5],
            [3.1, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            "revolute",
        ),
    ];
    let mut text = String::from("convention = 'khalil-kleinfinger'\n");
    for (xyz, rpy, axis, kind) in joints {
        let axis = match kind {
            "fixed" => String::new(),
            _ => format!("axis = {axis:?}\n"),
        };
        text += &format!(
            "[[joint]]\ntype = '{kind}'\nconvention = 'urdf'\nxyz = {xyz:?}\nrpy = {rpy:?}\n{axis}"
        );
    }
    let robot = read(&text);
    for q in postures(4) {
        let mut expected = Isometry3::identity();
        let mut readings = q.iter();
        for (xyz, [roll, pitch, yaw], axis, kind) in joints {
            let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            expected *= Isometry3::from_parts(Translation3::from(xyz), turn);
            let axis = Unit::new_normalize(Vector3::from(axis));
            expected *= match kind {
                "revolute" => Isometry3::from_parts(
                    Translation3::identity(),
                    UnitQuaternion::from_axis_angle(&axis, *readings.next().unwrap()),
                ),
                "prismatic" => {
                    Translation3::from(axis.into_inner() * *readings.next().unwrap()).into()
                }
                _ => Isometry3::identity(),
            };
        }
        assert_stands_at(&robot, &q, &expected);
    }
}

/// A planar arm in the plane y = 0 whose links turn about −y: z is up.
const PLANAR: &str = "convention = 'khalil-kleinfinger'\n[[joint]]\nname = 'a'\ntype = 'revolute'\nalpha = '90 deg'\n\
                      MODEL\n[[joint]]\nname = 'b'\ntype = 'revolute'\nd = 0.7\nELBOW\n[tool]\nd = 0.5\n";

fn planar(model: &str, elbow: &str) -> Robot {
    read(&PLANAR.replace("MODEL", model).replace("ELBOW", elbow))
}

/// Where the tip of the planar arm is, with the angles of both links to the horizontal.
fn tip(first: f64, second: f64) -> Vector3<f64> {
    Vector3::new(
        0.7 * first.cos() + 0.5 * second.cos(),
        0.0,
        0.7 * first.sin() + 0.5 * second.sin(),
    )
}

/// A parallelogram holds the second link's angle to the horizontal.
#[test]
fn a_parallelogram_is_a_coupling_of_minus_one() {
    let robot = planar("", "model = ['gain', 'coupling(a)']\ncoupling_a = -1.0");
    for q in postures(2) {
        let found = robot.forward(&robot.nominal(), &q).translation;
        assert!((found - tip(q[0], q[1])).norm() < 1e-14);
    }
}

/// A spline shaft: the screw on joint a moves by its pitch as joint a turns; one column for both.
#[test]
fn two_joints_move_with_one_reading() {
    let robot = read(
        "convention = 'kk'\n[[joint]]\nname = 'a'\ntype = 'revolute'\n[[joint]]\nname = 'screw'\ntype = 'prismatic'\n\
         reading = 'a'\ngain = 0.01\n",
    );
    assert_eq!(robot.joints().len(), 1);
    for q in postures(1) {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), q[0]);
        let up = Translation3::new(0.0, 0.0, 0.01 * q[0]);
        assert_stands_at(&robot, &q, &Isometry3::from_parts(up, turn));
    }
}

/// The sag of the first joint: masses times their horizontal distances from it, for each model that has it.
#[test]
fn gravity_pulls_at_its_arm() {
    let (m, c) = (3.0, 2e-5);
    let lumped = planar("model = ['gain', 'gravity(2)']\ngravity_2 = -2e-3", "");
    let torque = planar(
        "model = ['gain', 'compliance']\ncompliance = 2e-5",
        "mass = 3.0\ncenter_of_mass = [0.2, 0.0, 0.0]",
    );
    for q in postures(2) {
        // The axis is −y: turning lifts what stands in front, so down is against it.
        let elbow = 0.7 * q[0].cos();
        let sag = 2e-3 * elbow;
        let found = lumped.forward(&lumped.nominal(), &q).translation;
        let expected = tip(q[0] + sag, q[0] + sag + q[1]);
        assert!((found - expected).norm() < 1e-14, "{found} {expected}");
        let centre = elbow + 0.2 * (q[0] + q[1]).cos();
        let sag = -c * m * 9.81 * centre;
        let found = torque.forward(&torque.nominal(), &q).translation;
        let expected = tip(q[0] + sag, q[0] + sag + q[1]);
        assert!((found - expected).norm() < 1e-14, "{found} {expected}");
    }
}

/// Columns beside the readings: a load in its unit, a direction by its sign alone.
#[test]
fn further_columns_move_joints() {
    let robot = planar(
        "model = ['gain', 'linear(load)', 'backlash(side)']\nlinear_load = 1e-3\nbacklash = 2e-3",
        "model = ['gain', 'harmonics(2)']\ncos2 = 3e-3\nsin1 = -1e-3",
    );
    assert_eq!(robot.given(), 4);
    for q in postures(4) {
        let first = q[0] + 1e-3 * q[2] + 2e-3 * q[3].signum();
        let second = q[1] + 3e-3 * (2.0 * q[1]).cos() - 1e-3 * q[1].sin();
        let found = robot.forward(&robot.nominal(), &q).translation;
        assert!((found - tip(first, first + second)).norm() < 1e-14);
        // The regressor stands where the robot does.
        let mut regressor = Regressor::default();
        FrameWise.regressor(&robot, &robot.nominal(), &q, &mut regressor);
        assert!((regressor.tool.translation - found).norm() < 1e-14);
    }
}
