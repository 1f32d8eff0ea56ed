//! What stands in memory is checked once: errors name the set and the row, and nothing panics or never returns.

#[path = "support/puma.rs"]
mod puma;

use puma::puma;
use truing::manifold::Pose;
use truing::nalgebra::Vector3;
use truing_robot::kinds::{ball_bar, known_plane, pose, position, same_point, unknown_plane};
use truing_robot::{Calibration, MeasurementSet};

/// So many postures.
fn postures(count: usize) -> Vec<Vec<f64>> {
    let angle = |i: usize, k: usize| ((i * (k + 1)) as f64 * 0.7).sin();
    (0..count)
        .map(|i| (0..6).map(|k| angle(i, k)).collect())
        .collect()
}

fn points(count: usize) -> Vec<Vector3<f64>> {
    let robot = puma();
    let tip = |q: &Vec<f64>| robot.forward(&robot.nominal(), q).translation;
    postures(count).iter().map(tip).collect()
}

/// The error that a set leads to; it has these words.
#[track_caller]
fn refused(set: MeasurementSet, words: &[&str]) {
    let error = Calibration::of(puma())
        .measured(set)
        .calibrate()
        .unwrap_err()
        .to_string();
    for word in words {
        assert!(error.contains(word), "no {word} in: {error}");
    }
}

#[test]
fn fewer_points_than_postures() {
    let set = position("tracker", postures(60), &points(30));
    refused(set, &["`tracker`", "30", "60"]);
}

#[test]
fn more_lengths_than_postures() {
    let set = ball_bar("bar", postures(30), &[0.5; 31], None);
    refused(set, &["`bar`", "31", "30"]);
}

#[test]
fn fewer_labels_than_postures() {
    let labels = (0..9).map(|i| format!("p{}", i % 3));
    refused(
        same_point("cones", postures(12), labels),
        &["`cones`", "9", "12"],
    );
}

#[test]
fn a_robot_that_does_not_exist() {
    let set = position("tracker", postures(30), &points(30)).robot(3);
    refused(set, &["`tracker`", "robot number 3, of 1"]);
}

#[test]
fn a_joint_vector_that_is_too_short() {
    let mut q = postures(30);
    q[7].pop();
    refused(position("tracker", q, &points(30)), &["`tracker`", "row 7"]);
}

#[test]
fn a_joint_that_is_not_a_number() {
    let mut q = postures(30);
    q[7][2] = f64::NAN;
    let set = position("tracker", q, &points(30));
    refused(
        set.frame("world").target("ball"),
        &["`tracker`", "row 7", "NaN"],
    );
}

#[test]
fn a_point_that_is_not_a_number() {
    for bad in [f64::NAN, f64::INFINITY] {
        let mut at = points(30);
        at[7].y = bad;
        let set = position("tracker", postures(30), &at);
        refused(
            set.frame("world").target("ball"),
            &["`tracker`", "row 7", "`y`"],
        );
    }
}

#[test]
fn a_pose_that_is_not_a_number() {
    let mut poses = vec![Pose::identity(); 30];
    poses[7].rotation[(0, 0)] = f64::NAN;
    let set = pose("camera", postures(30), &poses);
    refused(set.frame("world").target("board"), &["`camera`", "row 7"]);
}

#[test]
fn a_length_that_is_none() {
    let mut lengths = [0.5; 30];
    lengths[7] = -0.5;
    refused(
        ball_bar("bar", postures(30), &lengths, None),
        &["`bar`", "row 7", "more than 0"],
    );
}

#[test]
fn a_standard_deviation_that_is_none() {
    for sigma in [0.0, -1.0, f64::NAN] {
        let set = position("tracker", postures(30), &points(30)).sigma(&[sigma]);
        refused(set, &["`tracker`", "standard deviation"]);
    }
}

#[test]
fn no_measurements_and_no_sets() {
    refused(
        unknown_plane("touches", vec![], Vec::<String>::new()),
        &["nothing is left to estimate"],
    );
    assert!(Calibration::of(puma()).calibrate().is_err());
}

#[test]
fn two_sets_of_one_name() {
    let set = || position("tracker", postures(30), &points(30));
    let both = Calibration::of(puma()).measured(set()).measured(set());
    let error = both.calibrate().unwrap_err().to_string();
    assert!(error.contains("`tracker`"), "{error}");
}

#[test]
fn a_name_that_no_parameter_has() {
    let set = position("tracker", postures(30), &points(30));
    let wrong = Calibration::of(puma())
        .measured(set)
        .estimating(&["theta9"]);
    let error = wrong.calibrate().unwrap_err().to_string();
    assert!(error.contains("theta9"), "{error}");
}

#[test]
fn a_plane_that_is_not_a_number() {
    let plane = truing::manifold::Plane {
        normal: Vector3::new(0.0, 0.0, f64::NAN),
        distance: 0.1,
    };
    let set = known_plane("table", postures(30), plane);
    assert!(Calibration::of(puma()).measured(set).calibrate().is_err());
}
