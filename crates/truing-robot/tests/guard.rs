//! What a calibration says of a result that should not be believed, or not quite.

#[path = "support/puma.rs"]
mod puma;

use puma::{Scene, What, puma, table};
use truing_robot::Arm;
use truing_robot::result::CalibrationResult;

fn scene(what: &What, count: usize, sigma: f64) -> Scene {
    Scene::perturbed(vec![Arm::only(puma())], 5, |_, p| {
        !puma().parameters()[p].name.starts_with('K')
    })
    .measure(what, count, sigma)
}

#[track_caller]
fn says(result: &CalibrationResult, words: &str) -> bool {
    let said = result.warnings.iter().any(|w| w.contains(words));
    println!("{:?}", result.warnings);
    said
}

/// A robot that is nominal, touches that are noisy: the estimate is worse than nominal, and nothing
/// but the covariance can tell.
#[test]
fn a_covariance_worse_than_the_change_is_not_trusted() {
    let plane = What::UnknownPlane(vec![table()]);
    let mut distrusted = 0;
    for seed in 1..=20 {
        let nominal = Scene::nominal(vec![Arm::only(puma())], seed).measure(&plane, 40, 1e-3);
        let result = nominal.calibrate(false).result;
        assert!(result.termination.converged);
        distrusted += usize::from(
            says(&result, "no difference beyond chance")
                || says(&result, "than the registered nominal one"),
        );
        assert!(!result.trusted, "seed {seed}: {:?}", result.warnings);
    }
    assert!(distrusted >= 15, "{distrusted} of 20");
    // Many touches of a robot that is off by a millimetre and 0.3° are another matter.
    let result = scene(&plane, 200, 5e-5).calibrate(false).result;
    assert!(result.trusted, "{:?}", result.warnings);
}

/// However well it is measured, a robot that is nominal cannot be made better: what the estimate adds is within the
/// noise, and no better than chance.
#[test]
fn a_nominal_robot_is_not_made_better() {
    let nominal = Scene::nominal(vec![Arm::only(puma())], 4).measure(&What::Position, 50, 5e-5);
    let result = nominal.calibrate(false).result;
    assert!(!result.trusted && says(&result, "than the registered nominal one"));
}

#[test]
fn a_prior_that_the_data_contradict_is_named() {
    let mut calibration = scene(&What::Position, 40, 5e-5).calibration(false);
    let parameter = puma().parameter("d3").unwrap();
    let off = calibration.arms[0].robot.parameters()[parameter].nominal;
    calibration.estimate.priors = vec![("d3".into(), 1e-5)];
    let outcome = calibration.run(&|_| {}).unwrap();
    let moved = (outcome.state.robots[0][parameter] - off).abs();
    assert_eq!(
        says(&outcome.result, "the data contradict the `prior`: d3 by"),
        moved > 4e-5,
        "d3 moved by {moved:e}"
    );
    calibration.estimate.priors = vec![("d3".into(), 1e-2)];
    let outcome = calibration.run(&|_| {}).unwrap();
    assert!(!says(&outcome.result, "contradict"));
}

#[test]
fn an_active_bound_is_named_with_its_side() {
    let free = scene(&What::Position, 40, 5e-5);
    let parameter = puma().parameter("d3").unwrap();
    let outcome = free.calibrate(false);
    let nominal = puma().parameters()[parameter].nominal;
    let change = outcome.state.robots[0][parameter] - nominal;
    assert!(change.abs() > 1e-4, "{change}");
    let mut calibration = free.calibration(false);
    calibration.estimate.bounds = vec![("d3".into(), -0.5 * change.abs(), 0.5 * change.abs())];
    let outcome = calibration.run(&|_| {}).unwrap();
    let side = if change < 0.0 { "lower" } else { "upper" };
    assert!(says(&outcome.result, &format!("d3 ({side})")));
}

/// Unknown planes say nothing of the scale, so one length stays nominal and says that it does.
#[test]
fn what_holds_the_scale_is_said() {
    let result = scene(&What::UnknownPlane(vec![table()]), 100, 5e-5)
        .calibrate(false)
        .result;
    assert!(says(&result, "leave the scale free") && says(&result, "held by r6"));
}

/// Touches in a small corner say little of the robot: what moved far on such a base is named with
/// its standard deviation.
#[test]
fn what_moved_far_on_weak_data_is_named_with_its_uncertainty() {
    let mut narrow = scene(&What::Position, 60, 2e-4);
    let middle = narrow.sets[0].tools[0].q[0].clone();
    for q in &mut narrow.sets[0].tools[0].q {
        for (q, m) in q.iter_mut().zip(&middle) {
            *q = m + 0.05 * (*q - m);
        }
    }
    // The readings of the true robot there.
    let postures = narrow.sets[0].tools[0].q.clone();
    let robot = puma();
    let truth = &narrow.truth.robots[0];
    for (k, q) in postures.iter().enumerate() {
        let noise = 2e-4 * ((k * 7919) as f64).sin();
        let point = robot.forward(truth, q).translation.add_scalar(noise);
        let row = narrow.sets[0].values.row_mut(k);
        row.copy_from_slice(point.as_slice());
    }
    let result = narrow.calibrate(false).result;
    assert!(says(&result, "only weakly") || says(&result, "not determined by these data"));
}

/// A table in millimetres that says metres, or the other way round: what validates is nowhere near.
#[test]
fn a_robot_in_the_wrong_unit_is_not_trusted() {
    let right = scene(&What::UnknownPlane(vec![table()]), 60, 5e-5);
    let seen = right.clone().seeded(9).measure(&What::Position, 20, 1e-5);
    for factor in [1e-3, 1e3] {
        let mut file = puma().with_parameters(&puma().nominal());
        for row in file.joints.iter_mut().map(|j| &mut j.frame) {
            row.d *= factor;
            row.r *= factor;
        }
        for row in [&mut file.base, &mut file.tool] {
            row.d *= factor;
            row.r *= factor;
        }
        let mut calibration = right.calibration(false);
        calibration.arms = vec![Arm::only(truing_robot::Robot::new(&file))];
        calibration.validate = vec![seen.sets[1].clone()];
        let result = calibration.run(&|_| {}).unwrap().result;
        assert!(!result.trusted, "{factor}: {:?}", result.warnings);
    }
}

/// The same posture again and again determines nothing, and that is no success.
#[test]
fn data_that_determine_nothing_are_not_trusted() {
    let mut same = scene(&What::UnknownPlane(vec![table()]), 30, 0.0);
    let first = same.sets[0].tools[0].q[0].clone();
    same.sets[0].tools[0]
        .q
        .iter_mut()
        .for_each(|q| q.clone_from(&first));
    match same.calibration(false).run(&|_| {}) {
        Ok(outcome) => {
            let result = outcome.result;
            assert!(!result.trusted, "{:?}", result.warnings);
            assert!(says(&result, "determine none of the robot parameters"));
        }
        Err(error) => assert!(error.to_string().contains("nothing is left"), "{error}"),
    }
}
