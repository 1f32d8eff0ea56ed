//! A verdict does not depend on how large a robot is, on the order of rows or on what groups are called, and a robot that is
//! found not on which of the tables near its own it was found from.

use rand::seq::SliceRandom;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use truing::nalgebra::Vector3;
use truing_robot::doubt::Doubt;
use truing_robot::robot::{Convention, FrameRow, JointKind, JointRow, RobotFile};
use truing_robot::{Calibration, Outcome, Robot, kinds};

/// A six-axis arm so many times as large as one of a metre, with lengths and angles off by up to `off`.
fn arm(size: f64, off: f64, seed: u64) -> Robot {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut by = |at: f64| at + off * (2.0 * rng.random::<f64>() - 1.0);
    let h = std::f64::consts::FRAC_PI_2;
    let mut file = RobotFile::new("arm", Convention::KhalilKleinfinger);
    file.base = FrameRow {
        theta: 0.3,
        r: 0.4 * size,
        ..FrameRow::default()
    };
    for (k, (alpha, d, r)) in [
        (0.2, 0.15, 0.25),
        (-h, 0.0, 0.2435),
        (0.0, 0.4318, -0.0934),
        (h, -0.0203, 0.4331),
        (-h, 0.0, 0.0),
        (h, 0.0, 0.0),
    ]
    .into_iter()
    .enumerate()
    {
        let frame = FrameRow {
            alpha: by(alpha),
            d: by(d) * size,
            theta: by(0.0),
            r: by(r) * size,
            ..FrameRow::default()
        };
        let mut joint = JointRow::new(format!("q{}", k + 1), JointKind::Revolute, frame);
        joint.limits = Some([-2.0, 2.0]);
        file.joints.push(joint);
    }
    file.tool = FrameRow {
        alpha: 0.3,
        d: 0.12 * size,
        theta: 0.4,
        r: 0.08 * size,
        ..FrameRow::default()
    };
    Robot::new(&file)
}

/// Positions of an arm off by `off`, with noise that is stated `understated` times too small, in an order.
fn calibrated(size: f64, off: f64, rows: usize, understated: f64, order: Option<u64>) -> Outcome {
    let truth = arm(size, off, 5);
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut data: Vec<(Vec<f64>, Vector3<f64>)> = (0..rows)
        .map(|_| {
            let q: Vec<f64> = (0..6).map(|_| 4.0 * rng.random::<f64>() - 2.0).collect();
            let noise = Vector3::from_fn(|_, _| 4e-4 * size * (rng.random::<f64>() - 0.5));
            let at = truth.forward(&truth.nominal(), &q).translation + noise;
            (q, at)
        })
        .collect();
    if let Some(seed) = order {
        data.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
    }
    let (q, at): (Vec<_>, Vec<_>) = data.into_iter().unzip();
    let set = kinds::position("tracker", q, &at).sigma(&[1.2e-4 * size / understated]);
    Calibration::of(arm(size, 0.0, 0))
        .measured(set.frame("tracker"))
        .fixing(&["gains"])
        .calibrate()
        .unwrap()
}

/// The kinds of doubt, without their numbers.
fn kinds_of(outcome: &Outcome) -> Vec<String> {
    let name = |doubt: &Doubt| serde_json::to_value(doubt).unwrap()["kind"].to_string();
    outcome.result.doubts.iter().map(name).collect()
}

#[test]
fn one_problem_at_every_size_has_one_verdict() {
    for (off, rows, understated) in [
        (3e-3, 40, 1.0),
        (3e-5, 20, 1.0),
        (3e-3, 40, 20.0),
        (5e-4, 14, 1.0),
    ] {
        let of_a_metre = calibrated(1.0, off, rows, understated, None);
        for size in [1e-3, 1e-2, 30.0, 100.0] {
            let other = calibrated(size, off, rows, understated, None);
            assert_eq!(
                other.result.trusted, of_a_metre.result.trusted,
                "size {size}, off {off}"
            );
            assert_eq!(
                kinds_of(&other),
                kinds_of(&of_a_metre),
                "size {size}, off {off}"
            );
            let (a, b) = (
                &other.result.everywhere[0],
                &of_a_metre.result.everywhere[0],
            );
            assert!(
                (a.expected / size / b.expected - 1.0).abs() < 1e-3,
                "{a:?} {b:?}"
            );
        }
    }
}

#[test]
fn the_order_of_rows_makes_no_difference() {
    for (off, rows) in [(3e-3, 40), (3e-5, 20), (5e-4, 14)] {
        let sorted = calibrated(1.0, off, rows, 1.0, None);
        for seed in 0..3 {
            let shuffled = calibrated(1.0, off, rows, 1.0, Some(seed));
            assert_eq!(kinds_of(&shuffled), kinds_of(&sorted));
            let (a, b) = (&shuffled.result.everywhere[0], &sorted.result.everywhere[0]);
            assert!((a.expected / b.expected - 1.0).abs() < 1e-4, "{a:?} {b:?}");
            assert!((a.bound / b.bound - 1.0).abs() < 1e-4, "{a:?} {b:?}");
        }
    }
}

#[test]
fn what_is_trusted_is_better_than_nominal() {
    let good = calibrated(1.0, 3e-3, 40, 1.0, None);
    assert!(good.result.trusted, "{:?}", good.result.warnings);
    // A robot that is as good as its drawing cannot be made better with so much noise.
    let chance = calibrated(1.0, 3e-5, 20, 1.0, None);
    assert!(!chance.result.trusted);
    assert!(
        kinds_of(&chance)
            .iter()
            .any(|kind| kind.contains("prediction") || kind.contains("elsewhere")),
        "{:?}",
        chance.result.warnings
    );
}

/// Touches of three planes with the labels that `name` gives them.
fn touching(name: impl Fn(usize) -> String) -> Outcome {
    let truth = arm(1.0, 3e-3, 5);
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let (mut q, mut labels) = (Vec::new(), Vec::new());
    for k in 0..150 {
        let mut posture: Vec<f64> = (0..6).map(|_| 3.0 * rng.random::<f64>() - 1.5).collect();
        let normal = Vector3::ith(k % 3, 1.0);
        let height = [0.2, 0.1, 0.9][k % 3] + 1e-4 * (rng.random::<f64>() - 0.5);
        // Onto the plane by secant steps of the second and third joint.
        let above =
            |q: &[f64]| normal.dot(&truth.forward(&truth.nominal(), q).translation) - height;
        for step in 0..60 {
            let joint = 1 + step % 2;
            let at = above(&posture);
            let mut moved = posture.clone();
            moved[joint] += 1e-6;
            let slope = (above(&moved) - at) / 1e-6;
            if slope.abs() > 0.05 {
                posture[joint] -= (at / slope).clamp(-0.3, 0.3);
            }
        }
        if above(&posture).abs() < 1e-9 {
            q.push(posture);
            labels.push(name(k % 3));
        }
    }
    assert!(q.len() > 100, "{}", q.len());
    Calibration::of(arm(1.0, 0.0, 0))
        .measured(kinds::unknown_plane("touches", q, labels).sigma(&[3e-5]))
        .fixing(&["gains"])
        .calibrate()
        .unwrap()
}

#[test]
fn what_groups_are_called_makes_no_difference() {
    let one = touching(|k| ["a", "b", "c"][k].to_owned());
    let other = touching(|k| format!("wall {}", 9 - k));
    assert_eq!(one.result.trusted, other.result.trusted);
    assert_eq!(kinds_of(&one), kinds_of(&other));
    let bound = |outcome: &Outcome| outcome.result.everywhere[0].bound;
    assert!((bound(&one) / bound(&other) - 1.0).abs() < 1e-6);
}

/// RMS distance of the tools of two calibrated robots on fresh postures, after a rigid motion.
fn apart(one: &Outcome, other: &Outcome) -> f64 {
    let tools = |outcome: &Outcome| -> Vec<Vector3<f64>> {
        let robot = Robot::new(&outcome.robots[0].1);
        let mut rng = ChaCha8Rng::seed_from_u64(77);
        let posture = |rng: &mut ChaCha8Rng| -> Vec<f64> {
            (0..6).map(|_| 4.0 * rng.random::<f64>() - 2.0).collect()
        };
        (0..200)
            .map(|_| {
                robot
                    .forward(&robot.nominal(), &posture(&mut rng))
                    .translation
            })
            .collect()
    };
    let (from, to) = (tools(one), tools(other));
    let motion = truing_robot::measurement::fit::rigid_registration(&from, &to);
    let pairs = from.iter().zip(&to);
    let squares: f64 = pairs
        .map(|(p, q)| (q - motion.apply(p)).norm_squared())
        .sum();
    (squares / 200.0).sqrt()
}

/// Every entry of the nominal table, off by a little and by more: the same robot is found, to the noise.
#[test]
fn the_robot_found_is_continuous_in_the_nominal_table() {
    let truth = arm(1.0, 1e-3, 5);
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let mut noise = || 1e-4 * (rng.random::<f64>() - 0.5);
    let data: Vec<(Vec<f64>, Vector3<f64>)> = (0..40)
        .map(|i| {
            let q: Vec<f64> = (0..6)
                .map(|k| 2.0 * ((i * (k + 2)) as f64 * 0.61 + k as f64).sin())
                .collect();
            let at = truth.forward(&truth.nominal(), &q).translation;
            (q, at + Vector3::from_fn(|_, _| noise()))
        })
        .collect();
    let (q, at): (Vec<_>, Vec<_>) = data.into_iter().unzip();
    let calibrate = |robot: Robot| {
        Calibration::of(robot)
            .measured(
                kinds::position("tracker", q.clone(), &at)
                    .sigma(&[3e-5])
                    .frame("tracker"),
            )
            .fixing(&["gains"])
            .calibrate()
            .unwrap()
    };
    let nominal = arm(1.0, 0.0, 0);
    let from_nominal = calibrate(nominal.clone());
    let sure = from_nominal.result.everywhere[0].expected;
    for (k, parameter) in nominal.parameters().iter().enumerate() {
        // Gains are not estimated, and where the robot stands is given away.
        if parameter.name.starts_with('K') || nominal.base_parameters().contains(&k) {
            continue;
        }
        for off in [1e-6, 1e-5, 1e-4, 1e-3, 1e-2] {
            let mut values = nominal.nominal();
            values[k] += off;
            let outcome = calibrate(Robot::new(&nominal.with_parameters(&values)));
            let distance = apart(&from_nominal, &outcome);
            assert!(
                distance < 0.5 * sure,
                "{} off by {off}: {distance:e} of {sure:e}",
                parameter.name
            );
        }
    }
}
