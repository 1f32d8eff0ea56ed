//! Without noise, every kind of constraint alone, and all of them mixed, recovers the parameters it
//! identifies to 1e-9.

#[path = "support/puma.rs"]
mod puma;

use puma::{Scene, What, puma, table, two_pumas};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use truing::nalgebra::Vector3;
use truing_robot::identify::{Choice, Status};
use truing_robot::measurement::{Sampling, sample};
use truing_robot::robot::posture;
use truing_robot::{Arm, MeasurementSet, Outcome};

/// Largest error, relative to the parameters' own size: lengths to that of the arm, 0.43 m; angles
/// and gains to one.
///
/// Touches lie on their plane to 1e-12 m, and an unknown plane's Jacobian magnifies that by its
/// condition, some tens to some hundreds: 1e-10 is what a perfect solver could promise.
const RECOVERED: f64 = 1e-9;

fn visits() -> Vec<Vector3<f64>> {
    vec![
        Vector3::new(0.55, 0.2, 0.5),
        Vector3::new(-0.1, 0.6, 0.7),
        Vector3::new(0.3, -0.5, 0.9),
    ]
}

fn one() -> Vec<Arm> {
    vec![Arm::only(puma())]
}

/// Which parameters of which robot the measurements identify, of those asked for.
fn identified(scene: &Scene, gains: bool) -> Vec<Vec<bool>> {
    let choices = scene.choices(&[], |_, name| gains || !name.starts_with('K'));
    let mut choices = choices.into_iter();
    let of_arm = |arm: &Arm| {
        let n = arm.robot.parameters().len();
        let own = choices.by_ref().take(n);
        own.map(|(_, choice)| choice == Choice::Estimated).collect()
    };
    scene.arms.iter().map(of_arm).collect()
}

/// Largest error of a parameter; lengths relative to the upper arm.
fn worst_error(scene: &Scene, outcome: &Outcome) -> f64 {
    let mut worst = 0.0_f64;
    for ((arm, truth), estimate) in scene
        .arms
        .iter()
        .zip(&scene.truth.robots)
        .zip(&outcome.state.robots)
    {
        for (p, (truth, estimate)) in arm
            .robot
            .parameters()
            .iter()
            .zip(truth.iter().zip(estimate))
        {
            let size = if p.unit().symbol() == "m" {
                0.4318
            } else {
                1.0
            };
            worst = worst.max((truth - estimate).abs() / size);
        }
    }
    worst
}

/// Perturbs what the measurements identify, and wants it back.
#[track_caller]
fn recovers(arms: &[Arm], measured: &[(What, usize)], gains: bool, count: usize) {
    let measure = |scene: Scene| {
        let each = measured.iter();
        each.fold(scene, |scene, (what, n)| scene.measure(what, *n, 0.0))
    };
    let chosen = identified(&measure(Scene::nominal(arms.to_vec(), 1)), gains);
    assert_eq!(chosen.iter().flatten().filter(|c| **c).count(), count);
    for seed in [2, 3, 4] {
        let scene = measure(Scene::perturbed(arms.to_vec(), seed, |r, p| chosen[r][p]));
        let outcome = scene.calibrate(gains);
        assert!(outcome.result.trusted, "{:?}", outcome.result.termination);
        for (k, parameter) in outcome.result.parameters.iter().enumerate() {
            let chosen = chosen.iter().flatten().nth(k).unwrap();
            let estimated = parameter.status == Status::Estimated;
            assert_eq!(estimated, *chosen, "{}: as at nominal", parameter.name);
        }
        let worst = worst_error(&scene, &outcome);
        println!(
            "{measured:?}: {worst:.1e}, condition {:.0}, {}",
            outcome.result.condition.unwrap(),
            outcome.result.termination.message
        );
        assert!(worst < RECOVERED, "{worst:e}");
    }
}

#[test]
fn poses() {
    recovers(&one(), &[(What::Pose, 40)], false, 30);
    recovers(&one(), &[(What::Pose, 40)], true, 36);
}

#[test]
fn positions() {
    recovers(&one(), &[(What::Position, 40)], false, 27);
    recovers(&one(), &[(What::Position, 40)], true, 33);
}

/// The tracker's frame (six) and the reflector (three) take the place of base and tool: of the robot
/// 18 remain.
#[test]
fn positions_of_an_unknown_reflector_in_the_frame_of_a_tracker() {
    recovers(&one(), &[(What::TrackedPosition, 40)], false, 18);
}

#[test]
fn touches_of_a_known_plane() {
    recovers(&one(), &[(What::KnownPlane(table()), 80)], false, 23);
    recovers(&one(), &[(What::KnownPlane(table()), 120)], true, 29);
}

#[test]
fn touches_of_an_unknown_plane() {
    let plane = What::UnknownPlane(vec![table()]);
    recovers(&one(), &[(plane.clone(), 80)], false, 20);
    recovers(&one(), &[(plane, 120)], true, 26);
}

#[test]
fn visits_of_the_same_points() {
    recovers(&one(), &[(What::SamePoint(visits()), 15)], false, 20);
    recovers(&one(), &[(What::SamePoint(visits()), 20)], true, 26);
}

/// Two tools that know each other's distance: 2 × 27 less the six motions of both robots together.
#[test]
fn distances_between_two_arms() {
    recovers(&two_pumas(), &[(What::TwoArms(0.116), 150)], false, 48);
}

/// A tool at a known distance from itself in another posture: 27 less the six motions of the robot.
#[test]
fn distances_between_two_postures() {
    recovers(&one(), &[(What::TwoPostures(0.5), 80)], false, 21);
}

#[test]
fn everything_mixed() {
    let all = [
        (What::Pose, 10),
        (What::Position, 15),
        (What::TrackedPosition, 15),
        (What::KnownPlane(table()), 20),
        (What::UnknownPlane(vec![table()]), 20),
        (What::SamePoint(visits()), 4),
        (What::TwoPostures(0.5), 20),
    ];
    recovers(&one(), &all, true, 36);
}

/// The tool points of a robot at postures that are drawn anew from the true one, as the estimate
/// sees them.
fn fresh(scene: &Scene, k: usize) -> MeasurementSet {
    let sampling = Sampling {
        count: 50,
        noise: None,
        near: None,
    };
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    sample(
        &scene.arms,
        &scene.sets[k],
        &scene.truth,
        &sampling,
        &mut rng,
    )
    .unwrap()
}

/// With errors in all parameters, also those that are not estimated, the others take over: what the
/// sensor will see next is predicted.
#[test]
fn errors_of_parameters_that_are_not_estimated_are_taken_over() {
    for (what, count) in [
        (What::Pose, 40),
        (What::Position, 40),
        (What::TrackedPosition, 40),
        (What::KnownPlane(table()), 120),
        (What::UnknownPlane(vec![table()]), 120),
        (What::SamePoint(visits()), 20),
        (What::TwoPostures(0.5), 100),
        (What::TwoArms(0.116), 250),
    ] {
        let arms = match what {
            What::TwoArms(_) => two_pumas(),
            _ => one(),
        };
        let scene = Scene::perturbed(arms, 5, |_, _| true).measure(&what, count, 0.0);
        let mut calibration = scene.calibration(true);
        calibration.held_out.push((0, fresh(&scene, 0)));
        let outcome = calibration.run(&|_| {}).unwrap();
        let after = outcome.result.validation[0].after.clone().unwrap();
        println!("{what:?}: {:.1e} m", after.max);
        assert!(after.max < RECOVERED, "{what:?}: {} m", after.max);
        if let Some(rotation) = after.rotation() {
            assert!(rotation.max < RECOVERED, "{} rad", rotation.max);
        }
    }
}

/// Positions are predicted anywhere, not only where they were measured.
#[test]
fn positions_are_predicted_everywhere_from_poses_and_positions() {
    for what in [What::Pose, What::Position] {
        let scene = Scene::perturbed(one(), 6, |_, _| true).measure(&what, 40, 0.0);
        let outcome = scene.calibrate(true);
        let robot = &scene.arms[0].robot;
        let mut rng = ChaCha8Rng::seed_from_u64(78);
        for _ in 0..100 {
            let q = posture::random(&posture::limits(robot), &mut rng);
            let truth = robot.forward(&scene.truth.robots[0], &q);
            let estimate = robot.forward(&outcome.state.robots[0], &q);
            assert!((truth.translation - estimate.translation).norm() < RECOVERED);
        }
    }
}
