//! `truing check` says whether all Jacobians agree, and where they do not.

use std::sync::Arc;
use truing_robot::Arm;
use truing_robot::Robot;
use truing_robot::check::Way;
use truing_robot::robot::Derivatives;
use truing_robot::robot::{DifferentiateChain, FrameWise, Regressor};

#[path = "support/cell.rs"]
mod cell;
#[path = "../crates/truing-robot/tests/support/puma.rs"]
mod puma;

use cell::Cell;
use puma::{Scene, What, puma, table};

/// Frame-wise differentiation with a slip in one column.
struct Slip {
    parameter: usize,
    factor: f64,
}

impl DifferentiateChain for Slip {
    fn regressor(&self, robot: &Robot, parameters: &[f64], q: &[f64], out: &mut Regressor) {
        FrameWise.regressor(robot, parameters, q, out);
        out.twists[self.parameter].linear *= self.factor;
    }
}

#[test]
fn a_wrong_column_is_found_and_named() {
    let robot = puma();
    let parameter = robot.parameter("d4").unwrap();
    let scene = Scene::nominal(vec![Arm::only(robot)], 1)
        .measure(&What::KnownPlane(table()), 20, 0.0)
        .measure(&What::Position, 10, 0.0);
    let calibration = scene.calibration(true);
    let way = |factor: f64| Way {
        name: "slip",
        derivatives: Derivatives::Regressor(Arc::new(Slip { parameter, factor })),
        tolerance: Way::EXACT,
    };
    let sets = calibration
        .check(&[way(1.0 + 1e-6), way(1.0), way(f64::NAN)])
        .unwrap();
    for set in &sets {
        let [slip, right, nan] = &set.ways[..] else {
            panic!("three ways");
        };
        assert!(!slip.agrees && slip.column == "d4", "{slip:?}");
        assert!((1e-7..1e-5).contains(&slip.difference), "{slip:?}");
        let others = slip.columns.iter().filter(|c| c.name != "d4");
        assert!(others.into_iter().all(|c| c.difference == 0.0));
        assert!(right.agrees && right.difference == 0.0);
        assert!(!nan.agrees && nan.column == "d4");
    }
}

#[test]
fn the_program_compares_all_ways_on_a_file() {
    let cell = Cell::new();
    let run = cell.run(&["check", "calibration.toml", "--json"]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    assert!(run.stderr.contains("all agree"), "{}", run.stderr);
    let json: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(json["agree"], true);
    let set = &json["constraints"][0];
    assert_eq!(set["name"], "tracker");
    assert_eq!(set["count"], 40);
    let ways = set["ways"].as_array().unwrap();
    let names: Vec<&str> = ways.iter().map(|w| w["way"].as_str().unwrap()).collect();
    assert_eq!(names, ["analytic", "whole-chain", "numeric"]);
    for way in ways {
        assert_eq!(way["agrees"], true, "{way}");
        assert!(way["seconds"].as_f64().unwrap() > 0.0);
        assert!(way["line"].as_u64().unwrap() >= 2);
        // 30 parameters, beta3 and six gains; what is held is not listed.
        assert_eq!(way["columns"].as_array().unwrap().len(), 37);
    }
    let run = cell.run(&["check", "nothing.toml"]);
    assert_eq!(run.status, 2);
}

#[test]
fn methods_of_the_plugin_are_checked_too() {
    let cell = Cell::new();
    cell.edit("calibration.toml", "sigma", "method = \"paper\"\nsigma");
    let run = cell.run(&["check", "calibration.toml"]);
    assert_eq!(run.status, 0, "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.contains("tracker (paper)"), "{}", run.stdout);
}
