//! The paper's methods (Khalil, Lemoine & Gautier 1996) as a plugin: their equations in calibration
//! files and from Rust, their results beside Truing's own, and what they cannot do.

use std::sync::Arc;
use truing::manifold::{Plane, Pose};
use truing::nalgebra::Vector3;
use truing_planar::{FixedPlane, Planar, Products, as_in_the_paper};
use truing_robot::file::CalibrationFile;
use truing_robot::load::{load, load_with};
use truing_robot::{Arm, Calibration, Outcome, Registry};

#[path = "support/cell.rs"]
mod cell;
#[path = "../crates/truing-robot/tests/support/puma.rs"]
mod puma;

use cell::Cell;
use puma::{Scene, What, puma, table};

/// A true robot with errors in the parameters that positions identify, and all that the others hold
/// at nominal.
fn scene(what: &What, count: usize, sigma: f64) -> Scene {
    let nominal = Scene::nominal(vec![Arm::only(puma())], 3).measure(what, 60, 0.0);
    let kept: Vec<String> = nominal
        .choices(&[], |_, name| !name.starts_with('K'))
        .into_iter()
        .filter(|(_, choice)| *choice == truing_robot::identify::Choice::Estimated)
        .map(|(name, _)| name)
        .collect();
    let robot = puma();
    Scene::perturbed(vec![Arm::only(puma())], 7, |_, p| {
        kept.contains(&robot.parameters()[p].name)
    })
    .measure(what, count, sigma)
}

fn run(calibration: Calibration) -> Outcome {
    let outcome = calibration.run(&|_| {}).unwrap();
    let termination = &outcome.result.termination;
    assert!(termination.converged, "{}", termination.message);
    outcome
}

/// The largest difference between two robots' parameters [m, rad].
fn apart(a: &[f64], b: &[f64]) -> f64 {
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, f64::max)
}

fn corner() -> Vec<Vector3<f64>> {
    vec![Vector3::new(0.6, 0.1, 0.5), Vector3::new(0.3, -0.5, 0.6)]
}

/// Places where the PUMA can be with its elbow up and down and its wrist either way.
fn locations() -> Vec<Pose<f64>> {
    let robot = puma();
    let postures = [
        [0.1, -0.4, 1.0, 0.3, 0.8, -0.5],
        [0.9, -0.8, 1.5, -0.6, 1.1, 0.4],
        [-0.7, -0.2, 0.7, 1.2, -0.9, 1.0],
        [0.5, -1.1, 1.8, 0.2, 0.6, -1.4],
        [-1.2, -0.6, 1.2, -0.9, 1.3, 0.2],
        [1.4, -0.3, 0.8, 0.8, -1.0, 0.9],
    ];
    postures.map(|q| robot.forward(&robot.nominal(), &q)).into()
}

fn kinds() -> [(What, usize); 6] {
    [
        (What::Position, 30),
        (What::Pose, 20),
        (What::KnownPlane(table()), 60),
        (What::UnknownPlane(vec![table()]), 60),
        (What::SamePoint(corner()), 30),
        (What::SameLocation(locations()), 12),
    ]
}

/// Without noise both end at the robot that was measured, to what rounding leaves of it at the
/// condition of the problem: that bounds their difference too.
#[test]
fn the_paper_and_truing_find_the_same_robot() {
    for (what, count) in kinds() {
        let scene = scene(&what, count, 0.0);
        let own = run(scene.calibration(false));
        let paper = run(as_in_the_paper(scene.calibration(false)).unwrap());
        let truth = &scene.truth.robots[0];
        let (own, paper) = (&own.state.robots[0], &paper.state.robots[0]);
        let (a, b) = (apart(own, truth), apart(paper, truth));
        println!("{what:?}: Truing {a:.1e}, the paper {b:.1e}");
        assert!(a < 1e-9 && b < 1e-9, "{what:?}: {a:e}, {b:e}");
        assert!(apart(own, paper) < 1e-9);
    }
}

/// Positions and known planes are the same least-squares problem in both, so with noise too.
#[test]
fn with_noise_the_paper_and_truing_agree_where_they_minimise_the_same() {
    for what in [What::Position, What::KnownPlane(table())] {
        let scene = scene(&what, 60, 1e-4);
        let own = run(scene.calibration(false));
        let paper = run(as_in_the_paper(scene.calibration(false)).unwrap());
        let difference = apart(&own.state.robots[0], &paper.state.robots[0]);
        assert!(difference < 1e-8, "{what:?}: {difference:e}");
        // Residuals are weighed alike, though the paper's have no unit.
        let (a, b) = (own.result.sigma0.unwrap(), paper.result.sigma0.unwrap());
        assert!((a / b - 1.0).abs() < 1e-6, "{a} against {b}");
    }
}

/// With noise the paper's plane minimises Σ (a·x + b·y + c·z + 1)² and Truing's Σ (n·p − d)²: near to
/// each other, on the scale of the standard deviations.
#[test]
fn with_noise_an_unknown_plane_differs_by_less_than_its_uncertainty() {
    let scene = scene(&What::UnknownPlane(vec![table()]), 200, 1e-4);
    let own = run(scene.calibration(false));
    let paper = run(as_in_the_paper(scene.calibration(false)).unwrap());
    for (k, p) in own.result.parameters.iter().enumerate() {
        if let Some(sigma) = p.sigma {
            let difference = (p.estimate - paper.result.parameters[k].estimate).abs();
            assert!(
                difference < sigma,
                "{}: {difference:e} of {sigma:e}",
                p.name
            );
        }
    }
    let [a, b] = [&own, &paper].map(|o| o.result.planes[0].clone());
    assert!((a.distance - b.distance).abs() < 1e-3);
}

#[test]
fn vector_products_and_position_links_need_no_plane_and_no_point() {
    let scene = scene(&What::UnknownPlane(vec![table()]), 60, 0.0);
    let mut calibration = scene.calibration(false);
    calibration.sets[0].method = Some(Arc::new(Products));
    let products = run(calibration);
    let difference = apart(&products.state.robots[0], &scene.truth.robots[0]);
    assert!(difference < 1e-9, "{difference:e}");
    // The plane is fitted for the report.
    let plane = &products.result.planes[0];
    assert!((plane.distance - table().distance).abs() < 1e-8 && plane.rms < 1e-9);
    assert_eq!(products.result.identifiable, 20);
}

#[test]
fn a_fixed_plane_is_z_equal_to_zero() {
    let plane = Plane {
        normal: Vector3::z(),
        distance: 0.0,
    };
    let scene = scene(&What::KnownPlane(plane), 60, 0.0);
    let mut calibration = scene.calibration(false);
    calibration.sets[0].method = Some(Arc::new(FixedPlane));
    let fixed = run(calibration);
    let difference = apart(&fixed.state.robots[0], &scene.truth.robots[0]);
    assert!(difference < 1e-9, "{difference:e}");
    // The paper's own form has no such plane.
    let error = as_in_the_paper(scene.calibration(false)).err().unwrap();
    assert!(error.contains("through the origin"), "{error}");
}

/// Equation (12): P·(a, b, c) = −1 in the least-squares sense, here with an exact solution.
#[test]
fn the_plane_starts_at_the_solution_of_equation_12() {
    let touches = [
        Vector3::new(1.0, 0.0, 0.0),
        Vector3::new(0.0, 2.0, 0.0),
        Vector3::new(0.0, 0.0, -4.0),
        Vector3::new(1.0, 2.0, 4.0),
    ];
    // x + y/2 − z/4 = 1.
    let plane = truing_planar::Coefficients::fit(&touches);
    let [a, b, c] = truing_planar::Coefficients::of(&plane).unwrap();
    assert!((a + 1.0).abs() < 1e-12 && (b + 0.5).abs() < 1e-12 && (c - 0.25).abs() < 1e-12);
    // Minimal in Σ (P·x + 1)², which is not the plane of least distances.
    let off = [
        Vector3::new(1.1, 0.0, 0.0),
        Vector3::new(0.0, 2.0, 0.1),
        Vector3::new(0.2, 0.0, -4.0),
        Vector3::new(1.0, 2.3, 4.0),
    ];
    let [a, b, c] =
        truing_planar::Coefficients::of(&truing_planar::Coefficients::fit(&off)).unwrap();
    let gradient: Vector3<f64> = off
        .iter()
        .map(|p| p * (p.dot(&Vector3::new(a, b, c)) + 1.0))
        .sum();
    assert!(gradient.norm() < 1e-12, "{gradient}");
}

fn cell_with(lines: &str) -> Cell {
    let cell = Cell::new();
    cell.write(
        "calibration.toml",
        format!("[robot]\nfile = \"robot.toml\"\n{lines}"),
    );
    cell
}

#[test]
fn files_choose_methods_and_the_analytic_jacobian() {
    let cell = Cell::new();
    cell.edit("calibration.toml", "sigma", "method = \"paper\"\nsigma");
    cell.edit(
        "calibration.toml",
        "\n[[constraint]]",
        "\n[estimate]\njacobian = \"analytic\"\nsolver = \"gauss-newton\"\n\n[[constraint]]",
    );
    let run = cell.run(&["calibrate", "calibration.toml", "--json"]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let path = cell.path("calibration.toml");
    let registry = Registry::with(&[&Planar]);
    let file = CalibrationFile::read_with(&path, &registry).unwrap();
    let calibration = load_with(&file, &registry).unwrap();
    let method = calibration.sets[0].method.as_ref().unwrap();
    assert_eq!(method.name(), "paper");
    // Without the plugin neither is there.
    let error = load(&file).err().unwrap().to_string();
    assert!(error.contains("analytic"), "{error}");
    let error = CalibrationFile::read(&path).err().unwrap().to_string();
    assert!(error.contains("no method `paper`"), "{error}");
}

#[test]
fn a_method_that_is_not_there_is_said_with_those_that_are() {
    let constraint = "[[constraint]]\ndata = \"tracker.csv\"\n";
    for (lines, words) in [
        (
            "kind = \"position\"\nmethod = \"papre\"",
            ["no method `papre`", "paper"],
        ),
        (
            "kind = \"position\"\nmethod = \"vector-products\"",
            ["is for unknown-plane, not for position", "paper"],
        ),
        (
            "kind = \"known-plane\"\nmethod = \"paper\"",
            ["has no `plane`", "normal"],
        ),
        (
            "kind = \"known-plane\"\nmethod = \"paper\"\nplane = { normal = [0, 0, 1], distance = 0.0 }",
            ["through the origin", "method"],
        ),
        (
            "kind = \"known-plane\"\nmethod = \"fixed-plane\"\nplane = { normal = [0, 0, 1], distance = 0.1 }",
            ["plane of its own", "method"],
        ),
    ] {
        let cell = cell_with(&format!("{constraint}{lines}\n"));
        let run = cell.run(&["calibrate", "calibration.toml"]);
        assert_eq!(run.status, 2, "{lines}: {}", run.stderr);
        for word in words {
            assert!(run.stderr.contains(word), "{lines}: {}", run.stderr);
        }
        assert!(run.stderr.contains("calibration.toml:"), "{}", run.stderr);
    }
}
