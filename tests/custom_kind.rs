//! Kinds of measurement from outside: a draw-wire encoder, and a tracker whose scale is unknown. They are
//! calibrated from files, mixed with built-in kinds, with held-out rows, outliers, `check`, `identify`, `simulate`
//! and `study`, and recover the truth.

#[path = "support/plugin.rs"]
mod plugin;

use plugin::{assert_studied, json, simulated, succeeds, truing};
use std::fs;
use std::path::Path;
use std::process::ExitCode;

/// Everything that a kind from outside takes, to be counted.
// ANCHOR: all
mod draw_wire {
    use std::sync::Arc;
    use truing::manifold::{Point3, Vector};
    use truing::{Constraint, Scalar, Views};
    use truing_robot::measurement::*;
    use truing_robot::robot::Chain;
    use truing_robot::unknown::{Unknown, Value};
    use truing_robot::{Error, Plugin};

    #[derive(Clone)]
    struct Wire {
        chain: Arc<Chain>,
        q: Vec<f64>,
        length: f64,
    }
    impl Constraint for Wire {
        type Vars = (Vector, Point3, Point3);
        const DIM: usize = 1;
        fn residual<T: Scalar>(&self, (p, tip, anchor): Views<'_, Self, T>, r: &mut [T]) {
            let wire = self.chain.tip(p, &self.q, &tip) - anchor;
            r[0] = wire.dot(&wire).sqrt() - self.length;
        }
    }

    #[derive(Debug)]
    pub struct DrawWire;
    impl Kind for DrawWire {
        fn name(&self) -> &'static str {
            "draw-wire"
        }
        fn measurands(&self) -> &'static [Measurand] {
            &[Measurand::LENGTH]
        }
        fn columns(&self) -> &'static [DataColumn] {
            const { &[DataColumn::length("length")] }
        }
        fn unknowns(&self) -> Vec<Unknown> {
            vec![Unknown::place("anchor")]
        }
        fn start(&self, at: &At<'_>, _: usize) -> Vec<Value> {
            vec![Value::of::<Point3>(fit::mean(&at.all_tips()))]
        }
        fn equations(&self, on: &mut Equations<'_>) -> Result<(), Error> {
            on.add(|on, row| {
                let (tool, q, length) = (&on.tools[0], on.q(0, row), on.values(row)[0]);
                let chain = tool.chain.clone();
                let vars = (tool.robot, tool.point(), on.unknown("anchor", row));
                (vars, Wire { chain, q, length })
            })
        }
        fn place(&self, places: &mut Places<'_>) -> Placed {
            vec![Value::of::<Point3>(places.point())].into()
        }
        fn draw(&self, draw: &mut Draw<'_>) -> Result<Vec<f64>, Error> {
            let wire = draw.anywhere()[0].translation - draw.own::<Point3>("anchor");
            Ok(vec![wire.norm() + draw.error(0)])
        }
    }
    impl Plugin for DrawWire {
        fn kinds(&self) -> Vec<Arc<dyn Kind>> {
            vec![Arc::new(Self)]
        }
    }
}
// ANCHOR_END: all

/// A tracker that reads (1 + scale) times what is there: an unknown that is the instrument's.
mod scaled_tracker {
    use std::sync::Arc;
    use truing::manifold::{Point3, Vector};
    use truing::{Constraint, Scalar, Views};
    use truing_robot::measurement::*;
    use truing_robot::robot::{Chain, Unit};
    use truing_robot::unknown::{Unknown, Value};
    use truing_robot::{Error, Plugin};

    #[derive(Clone)]
    struct Reading {
        chain: Arc<Chain>,
        q: Vec<f64>,
        read: [f64; 3],
    }
    impl Constraint for Reading {
        type Vars = (Vector, Point3, Vector);
        const DIM: usize = 3;
        fn residual<T: Scalar>(&self, (p, tip, scale): Views<'_, Self, T>, r: &mut [T]) {
            let tip = self.chain.tip(p, &self.q, &tip);
            for k in 0..3 {
                r[k] = tip[k] * (scale[0] + 1.0) - self.read[k];
            }
        }
    }

    #[derive(Debug)]
    pub struct ScaledTracker;
    impl Kind for ScaledTracker {
        fn name(&self) -> &'static str {
            "scaled-tracker"
        }
        fn measurands(&self) -> &'static [Measurand] {
            &[Measurand::POSITION]
        }
        fn columns(&self) -> &'static [DataColumn] {
            const {
                &[
                    DataColumn::length("x"),
                    DataColumn::length("y"),
                    DataColumn::length("z"),
                ]
            }
        }
        fn unknowns(&self) -> Vec<Unknown> {
            vec![Unknown::instrument("scale")]
        }
        fn start(&self, _: &At<'_>, _: usize) -> Vec<Value> {
            vec![Value::number("scale", Unit::One, 0.0)]
        }
        fn equations(&self, on: &mut Equations<'_>) -> Result<(), Error> {
            on.add(|on, row| {
                let tool = &on.tools[0];
                let reading = Reading {
                    chain: tool.chain.clone(),
                    q: on.q(0, row),
                    read: on.values(row).try_into().unwrap(),
                };
                let vars = (tool.robot, tool.point(), on.unknown("scale", row));
                (vars, reading)
            })
        }
        fn place(&self, places: &mut Places<'_>) -> Placed {
            vec![Value::number(
                "scale",
                Unit::One,
                places.number(0.009, 0.011),
            )]
            .into()
        }
        fn draw(&self, draw: &mut Draw<'_>) -> Result<Vec<f64>, Error> {
            let tip = draw.anywhere()[0].translation;
            let read = tip * (1.0 + draw.own::<Vector>("scale")[0]) + draw.normal() * draw.noise[0];
            Ok(read.as_slice().to_vec())
        }
    }
    impl Plugin for ScaledTracker {
        fn kinds(&self) -> Vec<Arc<dyn Kind>> {
            vec![Arc::new(Self)]
        }
    }
}

const SIMULATION: &str = r#"
seed = 5
[robot]
file = "robot.toml"
[errors]
angle = "0.3 deg"
length = "1 mm"
fixed = ["gains"]
[[constraint]]
kind = "position"
data = "tracker.csv"
count = 40
sigma = "0.05 mm"
[[constraint]]
kind = "draw-wire"
data = "wire.csv"
count = 60
sigma = "0.05 mm"
"#;

const CALIBRATION: &str = r#"
[robot]
file = "robot.toml"
[estimate]
fixed = ["gains"]
[[constraint]]
kind = "position"
data = "data/tracker.csv"
sigma = "0.05 mm"
[[constraint]]
name = "wire"
kind = "draw-wire"
data = "data/wire.csv"
sigma = "0.05 mm"
holdout = { every = 4, rows = [0] }
"#;

/// The draw wire's files, simulated.
fn measured() -> tempfile::TempDir {
    simulated(&[
        ("simulation.toml", SIMULATION),
        ("calibration.toml", CALIBRATION),
    ])
}

/// Adds to a number of a row (from 0) of a CSV file, in its last column.
fn disturb(path: &Path, row: usize, by: f64) {
    let text = fs::read_to_string(path).unwrap();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let heading = lines
        .iter()
        .position(|line| !line.starts_with('#'))
        .unwrap();
    let line = &mut lines[heading + 1 + row];
    let (head, last) = line.rsplit_once(',').unwrap();
    let last: f64 = last.trim().parse().unwrap();
    *line = format!("{head},{}", last + by);
    fs::write(path, lines.join("\n") + "\n").unwrap();
}

/// The components of an unknown of a set in a result.
#[track_caller]
fn components(result: &serde_json::Value, set: &str, name: &str) -> Vec<serde_json::Value> {
    let all = result["unknowns"].as_array().unwrap();
    let one = all
        .iter()
        .find(|u| u["constraint"] == set && u["name"] == name);
    let one = one.unwrap_or_else(|| panic!("no {name} of {set} in {all:?}"));
    one["components"].as_array().unwrap().clone()
}

fn a_draw_wire_is_calibrated_from_a_file_with_positions() {
    let folder = measured();
    let result = json(folder.path(), "calibrate calibration.toml --json");
    assert_eq!(result["trusted"], true, "{result:#}");
    let wire = &result["validation"].as_array().unwrap()[0];
    assert_eq!(wire["name"], "wire");
    // The noise, not the errors of the robot, which are a hundred times as large.
    assert!(wire["after"]["rms"].as_f64().unwrap() < 1e-4, "{wire:#}");
    assert!(
        wire["registered"]["rms"].as_f64().unwrap() > 1e-3,
        "{wire:#}"
    );
    let truth = fs::read_to_string(folder.path().join("data/truth.json")).unwrap();
    let truth: serde_json::Value = serde_json::from_str(&truth).unwrap();
    let sigma = components(&result, "wire", "anchor");
    for (k, component) in sigma.iter().enumerate() {
        let sigma = component["sigma"].as_f64().unwrap();
        let [estimate, truth] =
            [&result, &truth].map(|all| all["points"][0]["position"][k].as_f64().unwrap());
        assert!(
            (estimate - truth).abs() < 5.0 * sigma,
            "{estimate} ± {sigma}, truly {truth}"
        );
    }
}

fn an_outlier_of_a_draw_wire_is_told_by_its_row() {
    let folder = measured();
    // Row 7 is not held out: rows 0, 4, 8, … are.
    disturb(&folder.path().join("data/wire.csv"), 7, 5e-3);
    let out = truing(folder.path(), "calibrate calibration.toml --json").1;
    let result: serde_json::Value = serde_json::from_str(&out).unwrap();
    let outliers = result["outliers"].as_array().unwrap();
    assert_eq!(outliers.len(), 1, "{outliers:#?}");
    assert_eq!(outliers[0]["constraint"], "wire");
    assert_eq!(outliers[0]["row"], 7);
}

fn the_other_commands_know_it() {
    let folder = measured();
    succeeds(folder.path(), "check calibration.toml");
    // What it identifies is what a ball bar does.
    let identified = |kind: &str| -> Vec<(String, String)> {
        let told = json(
            folder.path(),
            &format!("identify robot.toml --kind {kind} --json"),
        );
        let parameters = told["parameters"].as_array().unwrap().iter();
        parameters
            .map(|p| (p["name"].to_string(), p["status"].to_string()))
            .collect()
    };
    let named = identified("draw-wire");
    // Which of two lengths that do the same is left out is up to rounding.
    let count = |all: &[(String, String)]| all.iter().filter(|p| p.1.contains("estimated")).count();
    assert_eq!(count(&named), count(&identified("ball-bar")));
    // The 27 that positions identify, but for the six of a rigid motion.
    assert_eq!(count(&named), 21);
    let symmetries = |kind: &str| {
        json(
            folder.path(),
            &format!("identify robot.toml --kind {kind} --json"),
        )["symmetries"]
            .clone()
    };
    assert_eq!(symmetries("draw-wire"), symmetries("ball-bar"));
    assert_eq!(symmetries("ball-bar").as_array().unwrap().len(), 6);
    assert_studied(folder.path(), &[("position", 40), ("draw-wire", 40)]);
}

fn a_misspelt_kind_is_told_the_nearest_name() {
    let wrong = CALIBRATION.replace("\"draw-wire\"", "\"draw-wier\"");
    let folder = plugin::folder(&[("calibration.toml", &wrong)]);
    let (status, _, error) = truing(folder.path(), "calibrate calibration.toml");
    assert_eq!(status, 2, "{error}");
    assert!(error.contains("draw-wire"), "{error}");
    let wrong = CALIBRATION.replace("holdout", "anker = 1\nholdout");
    let folder = plugin::folder(&[("calibration.toml", &wrong)]);
    let (status, _, error) = truing(folder.path(), "calibrate calibration.toml");
    assert_eq!(status, 2, "{error}");
    assert!(error.contains("anker"), "{error}");
}

fn all_of_a_kind_takes_at_most_sixty_lines() {
    let text = include_str!("custom_kind.rs");
    let module = text.split("mod draw_wire {").nth(1).unwrap();
    let module = module.split("\n}\n").next().unwrap();
    let lines = module.lines().filter(|line| !line.trim().is_empty());
    assert!(lines.clone().count() <= 60, "{}", lines.count());
}

fn a_sensors_scale_is_an_unknown_with_its_deviation() {
    let simulation = r#"
seed = 5
[robot]
file = "robot.toml"
[errors]
angle = "0.3 deg"
[[constraint]]
kind = "scaled-tracker"
data = "tracker.csv"
count = 80
sigma = "0.05 mm"
"#;
    let calibration = r#"
[robot]
file = "robot.toml"
[estimate]
parameters = ["theta*", "alpha*"]
[[constraint]]
name = "tracker"
kind = "scaled-tracker"
data = "data/tracker.csv"
sigma = "0.05 mm"
"#;
    let folder = simulated(&[
        ("simulation.toml", simulation),
        ("calibration.toml", calibration),
    ]);
    let result = json(folder.path(), "calibrate calibration.toml --json");
    let scale = &components(&result, "tracker", "scale")[0];
    let [scale, sigma] = ["estimate", "sigma"].map(|key| scale[key].as_f64().unwrap());
    assert!((0.009..0.011).contains(&scale), "{scale} ± {sigma}");
    assert!(sigma > 0.0 && sigma < 1e-3, "{sigma}");
    // With lengths, it competes with the size of the robot itself.
    let all = json(
        folder.path(),
        "identify robot.toml --kind scaled-tracker --json",
    );
    assert_eq!(all["symmetries"], serde_json::json!(["scale"]), "{all:#}");
}

fn main() -> ExitCode {
    let plugins: [&dyn truing_robot::Plugin; 3] = [
        &truing_planar::Planar,
        &draw_wire::DrawWire,
        &scaled_tracker::ScaledTracker,
    ];
    plugin::main(
        &plugins,
        &[
            (
                "a_draw_wire_is_calibrated_from_a_file_with_positions",
                a_draw_wire_is_calibrated_from_a_file_with_positions,
            ),
            (
                "an_outlier_of_a_draw_wire_is_told_by_its_row",
                an_outlier_of_a_draw_wire_is_told_by_its_row,
            ),
            ("the_other_commands_know_it", the_other_commands_know_it),
            (
                "a_misspelt_kind_is_told_the_nearest_name",
                a_misspelt_kind_is_told_the_nearest_name,
            ),
            (
                "all_of_a_kind_takes_at_most_sixty_lines",
                all_of_a_kind_takes_at_most_sixty_lines,
            ),
            (
                "a_sensors_scale_is_an_unknown_with_its_deviation",
                a_sensors_scale_is_an_unknown_with_its_deviation,
            ),
        ],
    )
}
