//! Models of joints in files: what they read is simulated with its column, and every parameter is found again.

#[path = "support/plugin.rs"]
mod plugin;

use plugin::{ROBOT, assert_recovered, assert_studied, json, parameter, simulated, succeeds};
use std::process::ExitCode;

/// What each parameter truly is, with its unit.
const TRUTH: [(&str, f64, &str); 6] = [
    ("compliance_2", 2e-6, "rad/(N m)"),
    ("linear_load_2", 4e-5, "rad/1"),
    ("coupling_shoulder_3", -0.98, "1"),
    ("backlash_4", 5e-4, "rad"),
    ("cos1_5", 8e-4, "rad"),
    ("sin1_5", -6e-4, "rad"),
];

/// The robot of the example with models, at nominal (all zero but the coupling, a parallelogram's) or as it truly is.
fn robot(is_true: bool) -> String {
    let mut text = format!(
        "{ROBOT}\n[inputs]\ntau2 = {{ range = [-200.0, 200.0] }}\nload = {{ range = [0.0, 20.0] }}\n"
    );
    for (joint, models, frame) in [
        ("shoulder", "\"compliance(tau2)\", \"linear(load)\"", '2'),
        ("elbow", "\"coupling(shoulder)\"", '3'),
        ("wrist_roll", "\"backlash(side4)\"", '4'),
        ("wrist_bend", "\"harmonics(1)\"", '5'),
    ] {
        let mut keys = format!("model = [\"gain\", {models}]\n");
        for (name, value, unit) in TRUTH {
            let Some(key) = name.strip_suffix(frame).and_then(|n| n.strip_suffix('_')) else {
                continue;
            };
            let value = match is_true {
                true => value,
                false if frame == '3' => -1.0,
                false => 0.0,
            };
            keys += &match unit {
                "rad" => format!("{key} = \"{value:?} rad\"\n"),
                _ => format!("{key} = {value:?}\n"),
            };
        }
        let own = format!("name = \"{joint}\"\n");
        assert!(text.contains(&own));
        text = text.replace(&own, &format!("{own}{keys}"));
    }
    text
}

const CALIBRATION: &str = r#"
[robot]
file = "robot.toml"
[estimate]
fixed = ["gains"]
[[constraint]]
kind = "position"
data = "data/tracker.csv"
sigma = "0.05 mm"
holdout = { every = 4, rows = [0] }
[[constraint]]
kind = "same-point"
data = "data/cone.csv"
sigma = "0.05 mm"
"#;

const SIMULATION: &str = r#"
seed = 3
[robot]
file = "true.toml"
[[constraint]]
kind = "position"
data = "tracker.csv"
count = 120
sigma = "0.05 mm"
[[constraint]]
kind = "same-point"
data = "cone.csv"
count = 20
sigma = "0.05 mm"
"#;

fn measured() -> tempfile::TempDir {
    simulated(&[
        ("robot.toml", &robot(false)),
        ("true.toml", &robot(true)),
        ("simulation.toml", SIMULATION),
        ("calibration.toml", CALIBRATION),
    ])
}

fn every_parameter_is_found_again() {
    let folder = measured();
    let result = json(folder.path(), "calibrate calibration.toml --json");
    assert_eq!(result["trusted"], true, "{:#}", result["warnings"]);
    for (name, truth, unit) in TRUTH {
        assert_eq!(parameter(&result, name)["unit"], unit, "{name}");
        // No more than a fifth of what there is.
        assert_recovered(&result, name, truth, truth.abs() / 5.0);
    }
    let warnings = result["warnings"].to_string();
    assert!(!warnings.contains("do not pay"), "{warnings}");
}

fn the_other_commands_know_columns() {
    let folder = measured();
    succeeds(folder.path(), "check calibration.toml");
    let told = json(folder.path(), "identify calibration.toml --json");
    for (name, ..) in TRUTH {
        assert_eq!(parameter(&told, name)["status"], "estimated", "{name}");
    }
    assert_studied(folder.path(), &[("position", 80), ("ball-bar", 40)]);
}

/// Two joints move with one column, and a joint without a reading has a model alone.
fn joints_may_share_a_reading_or_have_none() {
    let robot = format!(
        "{}\n[inputs]\nheat = {{ range = [-1.0, 1.0] }}\n",
        ROBOT.replace(
            "[tool]",
            "[[joint]]\nname = \"screw\"\ntype = \"prismatic\"\nreading = \"flange\"\ngain = GAIN\n\n\
             [[joint]]\nname = \"mast\"\ntype = \"prismatic\"\nalpha = 40.0\nreading = \"none\"\n\
             model = [\"linear(heat)\"]\nlinear_heat = HEAT\n\n[tool]"
        )
    );
    let with = |gain: &str, heat: &str| robot.replace("GAIN", gain).replace("HEAT", heat);
    let folder = simulated(&[
        ("robot.toml", &with("0.005", "0.0")),
        ("true.toml", &with("0.0052", "0.003")),
        ("simulation.toml", SIMULATION),
        (
            "calibration.toml",
            &CALIBRATION.replace(
                "\"gains\"",
                "\"K1\", \"K2\", \"K3\", \"K4\", \"K5\", \"K6\"",
            ),
        ),
    ]);
    let result = json(folder.path(), "calibrate calibration.toml --json");
    assert_eq!(result["trusted"], true, "{:#}", result["warnings"]);
    assert_recovered(&result, "K7", 0.0052, 1e-4);
    assert_recovered(&result, "linear_heat_8", 0.003, 1e-4);
}

fn main() -> ExitCode {
    plugin::main(
        &[],
        &[
            (
                "every_parameter_is_found_again",
                every_parameter_is_found_again,
            ),
            (
                "the_other_commands_know_columns",
                the_other_commands_know_columns,
            ),
            (
                "joints_may_share_a_reading_or_have_none",
                joints_may_share_a_reading_or_have_none,
            ),
        ],
    )
}
