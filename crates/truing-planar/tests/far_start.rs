//! Robots that are far from their files are found, and what fits without being a robot is not.

#[path = "../../truing-robot/tests/support/puma.rs"]
mod puma;

use puma::{Scene, What, puma, table};
use std::path::{Path, PathBuf};
use truing::{Loss, Method};
use truing_planar::Planar;
use truing_robot::Registry;
use truing_robot::estimate::Strategy;
use truing_robot::file::StudyFile;
use truing_robot::identify::Choice;
use truing_robot::robot::ParameterKind;
use truing_robot::study::load_study;
use truing_robot::{Arm, Calibration};

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

/// How many robots of `trials` each method recovers, in the order of the file, at one mean tool error.
fn recovered(constraint: &str, error: &str, trials: usize) -> Vec<(String, usize)> {
    let text = format!(
        "seed = 77\ntrials = {trials}\n[robot]\nfile = \"puma560.toml\"\n[estimate]\nfixed = [\"gains\"]\n\
         [errors]\nangle = \"1 rad\"\nlength = \"1 m\"\ntool_error = [\"{error}\"]\n\
         [[case]]\nname = \"touches\"\n[[case.constraint]]\ncount = 100\n{constraint}\n\
         [[method]]\nname = \"direct\"\nstrategy = \"direct\"\n[[method]]\nname = \"Truing\"\n"
    );
    let file = StudyFile::parse(&text, examples().join("puma560/study.toml")).unwrap();
    let result = load_study(&file, &Registry::with(&[&Planar]))
        .unwrap()
        .run(Some(2), &Default::default(), &|| ())
        .unwrap();
    let rows = result.rows.iter();
    rows.map(|row| (row.method.clone(), row.recovered))
        .collect()
}

/// Mean tool errors of half a metre, on an arm that reaches one: plain steps find every other robot.
#[test]
fn robots_half_a_metre_off_come_back() {
    for constraint in [
        "kind = \"known-plane\"\nplane = \"random\"",
        "kind = \"unknown-plane\"",
        "kind = \"unknown-plane\"\nplane_distance = \"2 cm\"",
        "kind = \"unknown-plane\"\nsigma = \"0.1 mm\"",
    ] {
        let found = recovered(constraint, "0.55 m", 8);
        println!("{constraint:?}: {found:?}");
        assert_eq!(found[1].1, 8, "{constraint}: {found:?}");
        assert!(found[0].1 < 8, "a case that is not hard: {found:?}");
    }
}

fn calibration(seed: u64, size: f64) -> (Scene, Calibration) {
    let robot = puma();
    let kept: Vec<String> = Scene::nominal(vec![Arm::only(puma())], 3)
        .measure(&What::UnknownPlane(vec![table()]), 60, 0.0)
        .choices(&[], |_, name| !name.starts_with('K'))
        .into_iter()
        .filter(|(_, choice)| *choice == Choice::Estimated)
        .map(|(name, _)| name)
        .collect();
    let mut scene = Scene::perturbed(vec![Arm::only(puma())], seed, |_, p| {
        kept.contains(&robot.parameters()[p].name)
    });
    let nominal = robot.nominal();
    for (k, value) in scene.truth.robots[0].iter_mut().enumerate() {
        let angle = robot.parameters()[k].unit() == truing_robot::robot::Unit::Radian;
        // The errors of the scene are 0.3° and 1 mm.
        let grown = size / if angle { 0.3_f64.to_radians() } else { 1e-3 };
        *value = nominal[k] + (*value - nominal[k]) * grown;
    }
    let scene = scene.measure(&What::UnknownPlane(vec![table()]), 100, 1e-4);
    let calibration = scene.calibration(false);
    (scene, calibration)
}

/// What took continuations says so, counts them, and ends at the robot that was measured.
#[test]
fn a_far_start_is_told_and_counted() {
    let (mut told, mut failed) = (0, 0);
    for seed in 1..=6 {
        let (scene, mut calibration) = calibration(seed, 0.3);
        let outcome = calibration.run(&|_| {}).unwrap();
        let result = &outcome.result;
        assert!(result.termination.converged, "{:?}", result.termination);
        let truth = &scene.truth.robots[0];
        for (p, truth) in result.parameters.iter().zip(truth) {
            if let Some(sigma) = p.sigma {
                let off = (p.estimate - truth).abs();
                assert!(off < 6.0 * sigma, "{} {off:e} of {sigma:e}", p.name);
            }
        }
        let said = result.warnings.iter().any(|w| w.contains("continuation"));
        told += usize::from(said);
        calibration.estimate.strategy = Strategy::Direct;
        calibration.estimate.drawing = None;
        let direct = calibration.run(&|_| {}).unwrap();
        let lost = direct.solution.cost > 2.0 * outcome.solution.cost;
        failed += usize::from(lost);
        assert!(said || !lost, "seed {seed}: {:?}", result.warnings);
        if said {
            assert!(outcome.solution.evaluations.jacobian > 30);
        }
        assert!(
            !lost || !direct.result.trusted,
            "{:?}",
            direct.result.warnings
        );
    }
    assert!(told > 0 && failed > 0, "{told} {failed}");
}

/// Near robots are estimated as ever, step for step.
#[test]
fn a_near_start_takes_plain_steps() {
    for seed in 1..=3 {
        let (_, mut calibration) = calibration(seed, 2e-3);
        let auto = calibration.run(&|_| {}).unwrap();
        calibration.estimate.strategy = Strategy::Direct;
        let direct = calibration.run(&|_| {}).unwrap();
        assert_eq!(auto.state, direct.state);
        assert_eq!(auto.solution.iterations, direct.solution.iterations);
        assert!(
            !auto
                .result
                .warnings
                .iter()
                .any(|w| w.contains("continuation"))
        );
    }
}

/// Gauss–Newton is the plain method and stays it.
#[test]
fn gauss_newton_is_left_alone() {
    let (_, mut calibration) = calibration(1, 0.3);
    calibration.estimate.settings.method = Method::GaussNewton;
    let outcome = calibration.run(&|_| {}).unwrap();
    assert!(
        !outcome
            .result
            .warnings
            .iter()
            .any(|w| w.contains("continuation"))
    );
}

/// A robust loss weighs rows by how far they are off: not while the robot is far.
#[test]
fn a_robust_loss_does_not_keep_a_far_robot_away() {
    for seed in 1..=3 {
        let (scene, mut calibration) = calibration(seed, 0.3);
        calibration.sets[0].loss = Loss::huber(1.5).unwrap();
        let outcome = calibration.run(&|_| {}).unwrap();
        let truth = &scene.truth.robots[0];
        for (p, truth) in outcome.result.parameters.iter().zip(truth) {
            if let Some(sigma) = p.sigma {
                let off = (p.estimate - truth).abs();
                assert!(off < 6.0 * sigma, "{} {off:e} of {sigma:e}", p.name);
            }
        }
    }
}

/// Nor do outliers always: with errors about as large as the outliers are, a fifth of the touches, most
/// robots are found and the outliers named, and the others refused.
#[test]
fn outliers_do_not_keep_a_far_robot_away() {
    let mut found = 0;
    for seed in 1..=4 {
        let (scene, mut calibration) = calibration(seed, 0.03);
        calibration.sets[0].loss = Loss::tukey(4.685).unwrap();
        // Every fifth touch is of a table five centimetres higher.
        let higher = truing::manifold::Plane {
            distance: table().distance + 0.05,
            ..table()
        };
        let wrong = scene
            .clone()
            .measure(&What::UnknownPlane(vec![higher]), 20, 1e-4);
        let bad: Vec<usize> = (0..20).map(|k| 5 * k).collect();
        for (row, q) in bad.iter().zip(&wrong.sets[1].tools[0].q) {
            calibration.sets[0].tools[0].q[*row].clone_from(q);
        }
        let result = calibration.run(&|_| {}).unwrap().result;
        let named: Vec<usize> = result.outliers.iter().map(|o| o.row).collect();
        let truth = &scene.truth.robots[0];
        let estimates = result.parameters.iter().zip(truth);
        let worst = estimates
            .filter_map(|(p, truth)| Some((p.estimate - truth).abs() / p.sigma?))
            .fold(0.0, f64::max);
        let right = bad.iter().all(|row| named.contains(row)) && named.len() < 25 && worst < 6.0;
        assert!(
            right || !result.trusted,
            "seed {seed}: {worst:.1} σ, {named:?}"
        );
        found += usize::from(right);
    }
    assert!(found >= 3, "{found} of 4");
}

/// Measurements that are worse than they say: two starts that end alike decide, and no more are tried.
#[test]
fn an_understated_sigma_does_not_send_it_searching() {
    let (_, mut calibration) = calibration(4, 0.05);
    calibration.sets[0] = calibration.sets[0].clone().sigma(&[1e-5]);
    calibration.estimate.drawing = None;
    let auto = calibration.run(&|_| {}).unwrap();
    calibration.estimate.strategy = Strategy::Direct;
    let direct = calibration.run(&|_| {}).unwrap();
    assert!((auto.solution.cost / direct.solution.cost - 1.0).abs() < 1e-6);
    assert!(
        auto.solution.iterations < 150,
        "{}",
        auto.solution.iterations
    );
}

/// Time that runs out ends the search too, and is said.
#[test]
fn a_search_that_runs_out_of_time_says_so() {
    let (_, mut calibration) = calibration(1, 0.3);
    calibration.estimate.settings.timeout = Some(std::time::Duration::from_nanos(1));
    let result = calibration.run(&|_| {}).unwrap().result;
    let stopped = result
        .warnings
        .iter()
        .any(|w| w.contains("was stopped after"));
    assert!(stopped && !result.trusted, "{:?}", result.warnings);
}

/// An arm that lies flat: all axes parallel, the tool in one plane whatever the joints do. The touches
/// fit to rounding, and the result is refused with that reason.
#[test]
fn a_robot_whose_joints_do_not_matter_is_not_trusted() {
    let (_, mut calibration) = calibration(2, 2e-3);
    let robot = puma();
    let flat: Vec<f64> = robot
        .parameters()
        .iter()
        .map(|p| match p.kind {
            ParameterKind::Alpha if (2..=6).contains(&p.frame) => 0.0,
            ParameterKind::Beta => 0.0,
            _ => p.nominal,
        })
        .collect();
    calibration.estimate.from = Some(vec![flat]);
    calibration.estimate.drawing = None;
    let result = calibration.run(&|_| {}).unwrap().result;
    let rms = result.constraints[0].after.as_ref().unwrap().rms;
    assert!(rms < 1e-6, "it fits: {rms:e}");
    let said = result
        .warnings
        .iter()
        .any(|w| w.contains("its joints hardly matter"));
    assert!(said && !result.trusted, "{:?}", result.warnings);
}
