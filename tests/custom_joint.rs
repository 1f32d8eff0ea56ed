//! A model of a joint from outside: a gear whose wheel sits off its axis, a·sin(n·q + φ) with φ unknown. It is named
//! in a robot file, simulated, calibrated with held-out rows, asked about, bounded and studied, and recovers the
//! truth.

#[path = "support/plugin.rs"]
mod plugin;

use plugin::{
    ROBOT, assert_recovered, assert_studied, json, parameter, simulated, succeeds, truing,
};
use std::fs;
use std::path::Path;
use std::process::ExitCode;

/// Everything that a joint model from outside takes, to be counted.
// ANCHOR: all
mod eccentric {
    use truing::Scalar;
    use truing_robot::Plugin;
    use truing_robot::robot::{JointKind, JointModel, ModelParameter, NamedJointModel, Unit};

    /// s·sin(n·q) + c·(cos(n·q) − 1), of a gear of ratio n.
    #[derive(Debug)]
    struct Gear {
        ratio: f64,
    }
    impl JointModel for Gear {
        fn parameters(&self, _: JointKind) -> Vec<ModelParameter> {
            let zero = |name: &str| ModelParameter::zero(name, Unit::Radian);
            vec![zero("gear_s"), zero("gear_c")]
        }
        fn displacement<T: Scalar>(&self, p: &[T], x: &[T]) -> T {
            let turned = x[0] * self.ratio;
            p[0] * turned.sin() + p[1] * (turned.cos() - 1.0)
        }
    }
    pub struct Eccentric;
    impl Plugin for Eccentric {
        fn joint_models(&self) -> Vec<NamedJointModel> {
            let make = |words: &[&str]| match words {
                [ratio] => Some(Gear {
                    ratio: ratio.parse().ok()?,
                }),
                _ => None,
            };
            vec![NamedJointModel::new("eccentric", "eccentric(3)", make)]
        }
    }
}
// ANCHOR_END: all

/// The robot with the gear in its shoulder, and the values of the gear.
fn robot(values: &str) -> String {
    let joint = "name = \"shoulder\"\ntype = \"revolute\"";
    assert!(ROBOT.contains(joint));
    let with = format!("{joint}\nmodel = [\"gain\", \"eccentric(3)\"]\n{values}");
    ROBOT.replace(joint, &with)
}

const SIMULATION: &str = r#"
seed = 11
[robot]
file = "true.toml"
[[constraint]]
kind = "position"
data = "tracker.csv"
count = 90
sigma = "0.05 mm"
"#;

const CALIBRATION: &str = r#"
[robot]
file = "robot.toml"
[estimate]
fixed = ["gains"]
[[constraint]]
name = "tracker"
kind = "position"
data = "data/tracker.csv"
sigma = "0.05 mm"
holdout = { every = 3, rows = [0] }
"#;

fn write(folder: &Path, name: &str, text: &str) {
    fs::write(folder.join(name), text).unwrap();
}

/// Readings of a robot whose gear is off by 0.002 rad and −0.001 rad.
fn measured() -> tempfile::TempDir {
    simulated(&[
        ("robot.toml", &robot("")),
        (
            "true.toml",
            &robot("gear_s = \"2e-3 rad\"\ngear_c = \"-1e-3 rad\""),
        ),
        ("plain.toml", ROBOT),
        ("simulation.toml", SIMULATION),
        ("calibration.toml", CALIBRATION),
    ])
}

fn held_out(result: &serde_json::Value) -> f64 {
    result["validation"][0]["after"]["rms"].as_f64().unwrap()
}

fn a_gear_is_estimated_from_a_file() {
    let folder = measured();
    let result = json(folder.path(), "calibrate calibration.toml --json");
    assert_eq!(result["trusted"], true, "{result:#}");
    for (name, truth) in [("gear_s_2", 2e-3), ("gear_c_2", -1e-3)] {
        assert_eq!(parameter(&result, name)["unit"], "rad");
        assert_recovered(&result, name, truth, 1e-4);
    }
    // Without the gear, no robot of that shape predicts as well.
    let plain = CALIBRATION.replace("robot.toml", "plain.toml");
    write(folder.path(), "without.toml", &plain);
    let out = truing(folder.path(), "calibrate without.toml --json").1;
    let without: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert!(held_out(&result) < 1.3e-4, "{}", held_out(&result));
    assert!(held_out(&without) > 3.0 * held_out(&result));
}

fn what_is_written_is_read_again() {
    let folder = measured();
    // Drawings are about another nominal robot the second time.
    let free = CALIBRATION.replace("[estimate]", "[estimate]\ndrawing = false");
    write(folder.path(), "first.toml", &free);
    succeeds(folder.path(), "calibrate first.toml --output out");
    let again = free.replace("\"robot.toml\"", "\"out/robot.toml\"");
    write(folder.path(), "again.toml", &again);
    // What is calibrated already does not become better, which is said.
    let (status, out, _) = truing(folder.path(), "calibrate again.toml --json");
    assert_eq!(status, 1, "{out}");
    let result: serde_json::Value = serde_json::from_str(&out).unwrap();
    let gear = parameter(&result, "gear_s_2");
    let [nominal, estimate] = ["nominal", "estimate"].map(|key| gear[key].as_f64().unwrap());
    assert!((nominal - estimate).abs() < 1e-9, "{gear}");
}

fn bounds_hold_and_identify_knows_it() {
    let folder = measured();
    let bounded = CALIBRATION.replace(
        "fixed = [\"gains\"]",
        "fixed = [\"gains\"]\nbounds = { gear_s_2 = \"1e-3 rad\" }",
    );
    write(folder.path(), "bounded.toml", &bounded);
    let out = truing(folder.path(), "calibrate bounded.toml --json").1;
    let result: serde_json::Value = serde_json::from_str(&out).unwrap();
    let gear = parameter(&result, "gear_s_2")["estimate"].as_f64().unwrap();
    assert!((gear - 1e-3).abs() < 1e-9, "{gear}");
    let told = json(folder.path(), "identify robot.toml --kind position --json");
    for name in ["gear_s_2", "gear_c_2"] {
        assert_eq!(parameter(&told, name)["status"], "estimated", "{told:#}");
    }
    succeeds(folder.path(), "check calibration.toml");
}

fn a_study_estimates_it() {
    let folder = measured();
    assert_studied(folder.path(), &[("position", 60)]);
}

fn a_misspelt_model_is_told_what_there_is() {
    let folder = measured();
    let wrong = robot("").replace("eccentric(3)", "excentric(3)");
    write(folder.path(), "robot.toml", &wrong);
    let (status, _, error) = truing(folder.path(), "calibrate calibration.toml");
    assert_eq!(status, 2, "{error}");
    assert!(error.contains("eccentric"), "{error}");
}

fn all_of_a_model_takes_at_most_forty_lines() {
    let text = include_str!("custom_joint.rs");
    let module = text.split("mod eccentric {").nth(1).unwrap();
    let module = module.split("\n}\n").next().unwrap();
    let lines = module.lines().filter(|line| !line.trim().is_empty());
    assert!(lines.clone().count() <= 40, "{}", lines.count());
}

fn main() -> ExitCode {
    plugin::main(
        &[&truing_planar::Planar, &eccentric::Eccentric],
        &[
            (
                "a_gear_is_estimated_from_a_file",
                a_gear_is_estimated_from_a_file,
            ),
            (
                "what_is_written_is_read_again",
                what_is_written_is_read_again,
            ),
            (
                "bounds_hold_and_identify_knows_it",
                bounds_hold_and_identify_knows_it,
            ),
            ("a_study_estimates_it", a_study_estimates_it),
            (
                "a_misspelt_model_is_told_what_there_is",
                a_misspelt_model_is_told_what_there_is,
            ),
            (
                "all_of_a_model_takes_at_most_forty_lines",
                all_of_a_model_takes_at_most_forty_lines,
            ),
        ],
    )
}
