//! The examples run, and come out as they say.

#![allow(
    dead_code,
    reason = "an example's `main` is its own, the tests call its `run`"
)]

use approx::assert_abs_diff_eq;
use truing_robot::identify::Status;

#[path = "../crates/truing/examples/arc.rs"]
mod arc;
#[path = "../crates/truing/examples/bounds.rs"]
mod bounds;
#[path = "../crates/truing/examples/curve_fitting.rs"]
mod curve_fitting;
#[path = "../examples/custom_constraint.rs"]
mod custom_constraint;
#[path = "../crates/truing/examples/hello_world.rs"]
mod hello_world;
#[path = "../crates/truing/examples/hello_world_analytic.rs"]
mod hello_world_analytic;
#[path = "../crates/truing/examples/hello_world_numeric.rs"]
mod hello_world_numeric;
#[path = "../crates/truing-robot/examples/kinds.rs"]
mod kinds;
#[path = "../crates/truing/examples/lbfgs.rs"]
mod lbfgs;
#[path = "../examples/mixed_constraints.rs"]
mod mixed_constraints;
#[path = "../crates/truing/examples/observers.rs"]
mod observers;
#[path = "../crates/truing-robot/examples/tool_uncertainty.rs"]
mod tool_uncertainty;

#[test]
fn hello_world_is_the_same_with_automatic_analytic_and_numeric_derivatives() {
    let mut text = Vec::new();
    let automatic = hello_world::run(&mut text).unwrap();
    let analytic = hello_world_analytic::run(&mut text).unwrap();
    let numeric = hello_world_numeric::run(&mut text).unwrap();
    assert_abs_diff_eq!(automatic[0], 0.3, epsilon = 0.01);
    assert_abs_diff_eq!(automatic[1], 0.1, epsilon = 0.02);
    for k in 0..2 {
        assert_abs_diff_eq!(analytic[k], automatic[k], epsilon = 1e-9);
        assert_abs_diff_eq!(numeric[k], automatic[k], epsilon = 1e-7);
    }
}

#[test]
fn shares_with_limits_add_up_to_one_and_none_is_negative() {
    let [free, limited] = bounds::run(&mut Vec::new()).unwrap();
    assert!(free[2] < 0.0, "{free:?}");
    assert_eq!(limited[2], 0.0);
    assert_abs_diff_eq!(limited.iter().sum::<f64>(), 1.0, epsilon = 1e-15);
    assert_abs_diff_eq!(limited[0], 0.7, epsilon = 0.02);
}

#[test]
fn lbfgs_of_argmin_reaches_the_same_cost() {
    let [ours, theirs] = lbfgs::run(&mut Vec::new()).unwrap();
    assert_abs_diff_eq!(ours, theirs, epsilon = 1e-6 * ours);
}

#[test]
fn the_fitted_curve_has_the_certified_parameters_and_standard_deviations() {
    let result = curve_fitting::run(&mut Vec::new()).unwrap();
    let certified = curve_fitting::CERTIFIED.iter();
    for ((estimate, sigma), (b, s)) in result
        .iter()
        .zip(certified.zip(&curve_fitting::CERTIFIED_SIGMA))
    {
        // Eleven digits are certified.
        assert_abs_diff_eq!(*estimate, *b, epsilon = 1e-10 * b);
        assert_abs_diff_eq!(*sigma, *s, epsilon = 1e-10 * s);
    }
}

#[test]
fn mixed_constraints_reach_the_noise_of_the_measurements() {
    let result = mixed_constraints::run(&mut Vec::new()).unwrap();
    assert!(result.trusted, "{:?}", result.warnings);
    for set in &result.constraints {
        let (registered, after) = (
            set.registered.as_ref().unwrap(),
            set.after.as_ref().unwrap(),
        );
        // Simulated with 0.05 mm along each axis.
        assert!(after.rms < 0.1e-3, "{}: {}", set.name, after.rms);
        assert!(registered.rms > 10.0 * after.rms, "{}", set.name);
    }
    let estimated = |p: &&truing_robot::result::ParameterResult| p.status == Status::Estimated;
    assert!(result.parameters.iter().filter(estimated).count() >= 18);
}

#[test]
fn every_kind_identifies_what_its_measurements_depend_on() {
    let kinds = kinds::run(&mut Vec::new()).unwrap();
    let estimated = |(_, parameters): &(String, Vec<truing_robot::result::ParameterResult>)| {
        let found = parameters.iter().filter(|p| p.status == Status::Estimated);
        found.count()
    };
    let counts: Vec<(&str, usize)> = kinds
        .iter()
        .map(|kind| (kind.0.as_str(), estimated(kind)))
        .collect();
    // Those of position and planes are the counts of Khalil, Lemoine & Gautier 1996.
    assert_eq!(
        counts,
        [
            ("pose", 30),
            ("position", 27),
            ("known-plane", 23),
            ("unknown-plane", 20),
            ("same-point", 20),
            ("distance", 21),
        ]
    );
}

#[test]
fn a_constraint_of_one_s_own_finds_the_offsets_within_their_standard_deviations() {
    let offsets = custom_constraint::run(&mut Vec::new()).unwrap();
    assert_eq!(offsets.len(), 6);
    for (name, truth, found, sigma) in offsets {
        assert!(
            (found - truth).abs() < 3.0 * sigma,
            "{name}: {found} ± {sigma}, true {truth}"
        );
        assert!(
            sigma < 0.5 * truth.abs(),
            "{name} is hardly determined: ± {sigma}"
        );
    }
}

#[test]
fn an_observer_sees_the_solver_reach_the_minimum() {
    let mut text = Vec::new();
    let (point, termination) = observers::run(&mut text).unwrap();
    assert!(termination.is_some_and(|t| t.converged()));
    assert_abs_diff_eq!(point[0], 1.0, epsilon = 1e-9);
    assert_abs_diff_eq!(point[1], 1.0, epsilon = 1e-9);
    let text = String::from_utf8(text).unwrap();
    assert!(text.lines().count() > 5 && text.contains("damping"));
}

/// The closed form of a circle's covariance: with the rim at angles t, J has rows (−cos t, −sin t, −1).
#[test]
fn an_arc_is_as_sure_as_the_geometry_makes_it() {
    let arc = arc::run(&mut Vec::new()).unwrap();
    let row = |degrees: f64| {
        let t = degrees.to_radians();
        truing::nalgebra::Vector3::new(t.cos(), t.sin(), 1.0)
    };
    let rows: Vec<_> = (0..13).map(|k| row(5.0 * f64::from(k))).collect();
    let normal: truing::nalgebra::Matrix3<f64> = rows.iter().map(|j| j * j.transpose()).sum();
    let sigma = normal.try_inverse().unwrap() * 1e-4;
    let radius = sigma[(2, 2)].sqrt();
    let (found, deviation) = arc.radius;
    // The readings are off by 0.01 mm of 500: angles differ by 2e-5.
    assert!((deviation / radius - 1.0).abs() < 1e-3 && (found - 500.0).abs() < 3.0 * radius);
    let rho = sigma[(0, 2)] / (sigma[(0, 0)] * sigma[(2, 2)]).sqrt();
    assert_abs_diff_eq!(arc.correlation, rho, epsilon = 1e-4);
    for (rim, degrees) in arc.rim.iter().zip([30.0, 180.0]) {
        let g = row(degrees);
        let expected = (g.dot(&(sigma * g))).sqrt();
        assert!((rim.std_devs()[0] / expected - 1.0).abs() < 2e-3);
        assert!((rim.value[0] - 500.0).abs() < 3.0 * expected);
    }
    for (h, j) in arc.leverage.iter().zip(&rows) {
        assert_abs_diff_eq!(*h, 1e4 * j.dot(&(sigma * j)), epsilon = 1e-3);
    }
    assert_eq!(arc.misread.0, 11);
    assert!(arc.misread.1 < 0.05 / 13.0);
}

#[test]
fn the_tool_of_the_example_is_known_better_where_it_was_measured() {
    let poses = tool_uncertainty::run(&mut Vec::new()).unwrap();
    assert_eq!(poses.len(), 4);
    for pose in &poses {
        // Simulated with 0.05 mm along each axis.
        assert!(pose.position_sigma() > 1e-5 && pose.position_sigma() < 2e-4);
    }
}
