//! With noise, estimates scatter around the truth as the reported standard deviations say: chi-square
//! tests over 200 simulated calibrations from positions, touches and visits together.
//!
//! If the linearised covariance is right, the sum of n squared normalised errors follows χ²(n). Every
//! statistic here must lie between the quantiles that a normal deviate of ∓4 stands for, which one
//! good sum in 16,000 does not (6.3e-5; Abramowitz & Stegun 1964, table 26.1); over the 27
//! parameters, the 200 costs and the three sums together, that is a level of 1.5 %. The seeds are
//! fixed: the outcome is always the same.

#[path = "support/puma.rs"]
mod puma;

use puma::{Scene, What, puma, table};
use std::sync::OnceLock;
use truing::Covariance;
use truing::nalgebra::{DMatrix, DVector, Vector3};
use truing_robot::Arm;
use truing_robot::identify::{Choice, Status};
use truing_robot::model::Assembly;
use truing_robot::robot::Derivatives;

const SEEDS: u64 = 200;
/// Of the tracker, the touches and the visits: 0.05 mm.
const SIGMA: f64 = 5e-5;

/// Quantile of χ²(n) at a normal deviate: n (1 − 2/9n + z √(2/9n))³ (Wilson & Hilferty 1931; three
/// digits or better from 30 degrees of freedom on, Abramowitz & Stegun, 26.4.17).
fn quantile(n: usize, deviate: f64) -> f64 {
    let n = n as f64;
    let a = 2.0 / (9.0 * n);
    n * (1.0 - a + deviate * a.sqrt()).powi(3)
}

/// Whether a sum of squares may well be χ²(n).
#[track_caller]
fn assert_chi_square(what: &str, sum: f64, n: usize) {
    let (least, most) = (quantile(n, -4.0), quantile(n, 4.0));
    assert!(
        (least..most).contains(&sum),
        "{what}: {sum:.1} of {n} degrees of freedom is not between {least:.1} and {most:.1}"
    );
}

/// One calibration.
struct Trial {
    /// Error of each estimated parameter over its standard deviation as the noise model has it, with
    /// its name.
    normalised: Vec<(String, f64)>,
    /// eᵀ C⁻¹ e of all estimated parameters together, C their covariance.
    together: f64,
    /// Twice the cost: the sum of squared whitened residuals.
    squares: f64,
    /// Rows less everything estimated.
    degrees_of_freedom: usize,
    sigma0: f64,
}

fn scene(truth: &Scene, seed: u64) -> Scene {
    let points = vec![Vector3::new(0.55, 0.2, 0.5), Vector3::new(-0.1, 0.6, 0.7)];
    truth
        .clone()
        .seeded(seed)
        .measure(&What::Position, 25, SIGMA)
        .measure(&What::UnknownPlane(vec![table()]), 40, SIGMA)
        .measure(&What::SamePoint(points), 10, SIGMA)
}

fn trial(truth: &Scene, seed: u64) -> Trial {
    let scene = scene(truth, seed);
    let outcome = scene.free().calibrate().unwrap();
    let result = &outcome.result;
    assert!(result.trusted, "seed {seed}: {:?}", result.termination);
    assert_eq!(result.identifiable, 27, "seed {seed}");
    let sigma0 = result.sigma0.unwrap();

    let derivatives = Derivatives::default();
    let mut assembly =
        Assembly::new(&scene.arms, &scene.sets, &outcome.state, &derivatives).unwrap();
    let robot: Vec<usize> = (0..result.parameters.len())
        .filter(|k| result.parameters[*k].status == Status::Estimated)
        .collect();
    let others = |k: &usize| {
        let owner = &assembly.columns[*k].owner;
        owner.is_local()
    };
    let others: Vec<usize> = (0..assembly.columns.len()).filter(others).collect();
    assembly.free_only(&[robot.clone(), others].concat());
    let covariance = Covariance::at(&assembly.problem, &outcome.solution.values).unwrap();

    let error = |k: &usize| outcome.state.robots[0][*k] - scene.truth.robots[0][*k];
    let errors = DVector::from_iterator(robot.len(), robot.iter().map(error));
    let n = robot.len();
    let c = DMatrix::from_fn(n, n, |i, k| covariance.entry(robot[i], robot[k]));
    let normalised = robot.iter().map(|k| {
        // What is reported is scaled by σ₀, which has a test of its own.
        let sigma = result.parameters[*k].sigma.unwrap() / sigma0;
        (result.parameters[*k].name.clone(), error(k) / sigma)
    });
    Trial {
        normalised: normalised.collect(),
        together: errors.dot(&c.cholesky().unwrap().solve(&errors)),
        squares: 2.0 * result.cost,
        degrees_of_freedom: covariance.degrees_of_freedom(),
        sigma0,
    }
}

/// Errors in what positions identify: then estimates are compared with the truth one to one.
fn truth() -> Scene {
    let arms = vec![Arm::only(puma())];
    let choices =
        scene(&Scene::nominal(arms.clone(), 0), 1).choices(&[], |_, name| !name.starts_with('K'));
    Scene::perturbed(arms, 42, |_, p| choices[p].1 == Choice::Estimated)
}

/// All trials, made once for all tests.
fn trials() -> &'static [Trial] {
    static TRIALS: OnceLock<Vec<Trial>> = OnceLock::new();
    TRIALS.get_or_init(|| {
        let truth = truth();
        (1..=SEEDS).map(|seed| trial(&truth, seed)).collect()
    })
}

#[test]
fn every_parameter_scatters_as_its_standard_deviation_says() {
    let trials = trials();
    for (k, (name, _)) in trials[0].normalised.iter().enumerate() {
        let errors: Vec<f64> = trials.iter().map(|t| t.normalised[k].1).collect();
        let sum: f64 = errors.iter().map(|e| e * e).sum();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        println!("{name}: {sum:.0} of {SEEDS}, mean {mean:.2}");
        assert_chi_square(name, sum, trials.len());
        // Without bias: the mean of n unit deviates is a deviate of 1/√n.
        let deviate = mean * (trials.len() as f64).sqrt();
        assert!(deviate.abs() < 4.0, "{name}: mean {mean} σ");
    }
}

#[test]
fn all_parameters_together_scatter_as_their_covariance_says() {
    let trials = trials();
    let sum = trials.iter().map(|t| t.together).sum();
    assert_chi_square("eᵀ C⁻¹ e", sum, 27 * trials.len());
}

#[test]
fn costs_and_sigma0_are_what_the_noise_makes_them() {
    let trials = trials();
    let mut total = (0.0, 0);
    for (seed, t) in (1..).zip(trials) {
        // 75 rows of positions, 40 touches, 60 rows of visits; 27 parameters, a plane, two points.
        assert_eq!(t.degrees_of_freedom, 75 + 40 + 60 - 27 - 3 - 6);
        assert_chi_square(&format!("seed {seed}"), t.squares, t.degrees_of_freedom);
        let sigma0 = (t.squares / t.degrees_of_freedom as f64).sqrt();
        assert!((t.sigma0 - sigma0).abs() < 1e-9, "σ₀ is that of the cost");
        total = (total.0 + t.squares, total.1 + t.degrees_of_freedom);
    }
    assert_chi_square("all costs", total.0, total.1);
}

/// What the test of a parameter can find: a standard deviation that is wrong by a quarter.
#[test]
fn a_standard_deviation_wrong_by_a_quarter_would_be_found() {
    let n = SEEDS as usize;
    assert!(n as f64 / 1.25_f64.powi(2) < quantile(n, -4.0));
    assert!(n as f64 / 0.75_f64.powi(2) > quantile(n, 4.0));
    // Tabulated: χ² of 100 degrees of freedom at 0.975 and 0.025 (Abramowitz & Stegun, table 26.8).
    assert!((quantile(100, 1.959_964) - 129.561).abs() < 0.02);
    assert!((quantile(100, -1.959_964) - 74.222).abs() < 0.02);
}

/// With what the data barely see held near nominal, as by default, 95 % intervals hold the truth in 95 ± 1.5 %.
#[test]
fn intervals_hold_the_truth_with_the_drawing_too() {
    // Student's 97.5 % quantile at 130 degrees of freedom (Abramowitz & Stegun, table 26.10: 1.980 at 120).
    const QUANTILE: f64 = 1.979;
    let truth = truth();
    let (mut within, mut all) = (0, 0);
    for seed in 1..=100 {
        let scene = scene(&truth, seed);
        let outcome = scene.calibrate(false);
        assert!(
            outcome.result.trusted,
            "seed {seed}: {:?}",
            outcome.result.warnings
        );
        for (k, parameter) in outcome.result.parameters.iter().enumerate() {
            if let Some(sigma) = parameter.sigma {
                let error = outcome.state.robots[0][k] - scene.truth.robots[0][k];
                within += usize::from(error.abs() < QUANTILE * sigma);
                all += 1;
            }
        }
    }
    let share = f64::from(within as u32) / f64::from(all as u32);
    println!("{share:.4} of {all}");
    assert!((share - 0.95).abs() < 0.015, "{share:.4} of {all}");
}
