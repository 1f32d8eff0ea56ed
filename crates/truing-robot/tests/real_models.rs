//! Models of joints, general frames and bodies on the tool, on real measurements, from files that a user could have
//! written.
//!
//! The data are not part of the project: they are looked for in `TRUING_DATA`, or in `shared/data` beside the
//! checkout, and the tests report themselves ignored where they are absent. Reference figures are those of an
//! independent numpy program, as the data's own READMEs and results give them; rows whose number modulo 10 is 0, 3 or
//! 7 are held out.

use libtest_mimic::{Arguments, Failed, Trial};
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use truing_robot::file::CalibrationFile;
use truing_robot::judge::{ErrorSummary, SetResult};
use truing_robot::load::load;
use truing_robot::result::CalibrationResult;

const HOLDOUT: &str = "holdout = { every = 10, rows = [0, 3, 7] }\n";

fn data() -> PathBuf {
    match std::env::var_os("TRUING_DATA") {
        Some(folder) => PathBuf::from(folder),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
    }
}

fn nominal(path: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(data().join(path)).unwrap()).unwrap()
}

/// Runs a calibration in a folder with these files.
fn calibrate(files: &[(&str, String)]) -> CalibrationResult {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let text = text.replace("DATA", &data().display().to_string());
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let path = folder.path().join("calibration.toml");
    let calibration = load(&CalibrationFile::read(&path).unwrap_or_else(|e| panic!("{e}")))
        .unwrap_or_else(|e| panic!("{e}"));
    calibration.run(&|_| {}).unwrap().result
}

/// Root mean squares of positions over several sets, registered and calibrated [mm].
fn rms(sets: &[SetResult]) -> (f64, f64) {
    let count: usize = sets.iter().map(|set| set.count).sum();
    let mean = |of: &dyn Fn(&SetResult) -> f64| {
        let sum: f64 = sets.iter().map(|s| s.count as f64 * of(s).powi(2)).sum();
        (sum / count as f64).sqrt() * 1e3
    };
    (
        mean(&|set| set.registered.as_ref().unwrap().rms),
        mean(&|set| set.after.as_ref().unwrap().rms),
    )
}

fn near(what: &str, found: f64, reference: f64, tolerance: f64) -> Result<(), Failed> {
    println!("{what}: {found:.4}, reference {reference}");
    if (found - reference).abs() <= tolerance {
        return Ok(());
    }
    Err(format!("{what}: {found:.5}, reference {reference} ± {tolerance}").into())
}

fn less(what: &str, found: f64, than: f64) -> Result<(), Failed> {
    println!("{what}: {found:.4}, before {than:.4}");
    if found < than {
        return Ok(());
    }
    Err(format!("{what}: {found:.5} is not less than {than:.5}").into())
}

/// A table of the data as a robot file, with models for every joint by its name.
fn table(path: &str, models: &dyn Fn(&str) -> String) -> String {
    let json = nominal(path);
    let distal = json["convention"] == "dh";
    let (convention, keys) = if distal {
        let keys = [
            ("theta", "theta"),
            ("d", "d"),
            ("a", "a"),
            ("alpha", "alpha"),
        ];
        ("denavit-hartenberg", keys)
    } else {
        let keys = [
            ("alpha", "alpha"),
            ("d", "a"),
            ("theta", "theta"),
            ("r", "r"),
        ];
        ("khalil-kleinfinger", keys)
    };
    let mut text = format!("name = \"robot\"\nconvention = \"{convention}\"\n");
    let numbers = |text: &mut String, row: &Value| {
        for (key, from) in keys {
            writeln!(text, "{key} = {:?}", row[from].as_f64().unwrap()).unwrap();
        }
    };
    for row in json["rows"].as_array().unwrap() {
        let name = row["joint"].as_str().unwrap();
        let kind = if name == "q_ext" { "fixed" } else { "revolute" };
        writeln!(text, "[[joint]]\nname = {name:?}\ntype = \"{kind}\"").unwrap();
        numbers(&mut text, row);
        let models = models(name);
        if kind == "revolute" && !models.is_empty() {
            writeln!(text, "model = [{models}]").unwrap();
        }
    }
    if let Some(tool) = json.get("tool_row") {
        writeln!(text, "[tool]").unwrap();
        numbers(&mut text, tool);
    }
    text
}

/// The ABB IRB 120 with three reflectors: geometric (gains held), or with models of the joints.
fn irb(gains: bool, models: &dyn Fn(&str) -> String) -> CalibrationResult {
    let mut text = String::from("[robot]\nfile = \"robot.toml\"\n[estimate]\ndrawing = false\n");
    text += if gains { "" } else { "fixed = [\"K*\"]\n" };
    for target in ["s1", "s2", "s3"] {
        write!(
            text,
            "[[constraint]]\nkind = \"position\"\nname = \"{target}\"\ntarget = \"{target}\"\nframe = \"tracker\"\n\
             data = \"DATA/irb120_faro/samples.csv\"\nrows = \"valid == 1\"\n\
             columns = {{ x = \"{target}x\", y = \"{target}y\", z = \"{target}z\" }}\n{HOLDOUT}"
        )
        .unwrap();
    }
    let robot = table("irb120_faro/nominal.json", models);
    let result = calibrate(&[("robot.toml", robot), ("calibration.toml", text)]);
    assert!(result.trusted, "{:?}", result.warnings);
    result
}

/// The README's independent program, on a random split: geometric 0.604, gains and gravity 0.502, harmonics 0.495 mm.
fn irb120_with_models() -> Result<(), Failed> {
    let all = |models: &'static str| move |_: &str| models.to_owned();
    let with_gravity = |joint: &str| {
        let gravity = match joint {
            "q2" => ", \"gravity(3, 4)\"",
            "q3" => ", \"gravity(4)\"",
            _ => "",
        };
        format!("\"gain\", \"harmonics(2)\"{gravity}")
    };
    let held_out = |result: &CalibrationResult| rms(&result.validation).1;
    let geometric = irb(false, &all(""));
    let gains = irb(true, &all(""));
    let first = irb(true, &all("\"gain\", \"harmonics(1)\""));
    let second = irb(true, &all("\"gain\", \"harmonics(2)\""));
    let gravity = irb(true, &with_gravity);
    assert_eq!(geometric.identifiable, 33);
    assert_eq!(gains.identifiable, 39);
    assert_eq!(first.identifiable, 51);
    less("geometric", held_out(&geometric), 0.604)?;
    less("gains", held_out(&gains), 0.9 * held_out(&geometric))?;
    less("first harmonics", held_out(&first), held_out(&gains))?;
    // The second harmonics fit better and predict no better.
    let trained = |result: &CalibrationResult| rms(&result.constraints).1;
    less(
        "second harmonics, trained",
        trained(&second),
        trained(&first),
    )?;
    less("gravity", held_out(&gravity), held_out(&first))?;
    less("gravity, as the README's", held_out(&gravity), 0.495)
}

/// The Motoman over its whole workspace. With gravity on joints L and U: masses lumped at the frames beyond.
fn motoman_wide(fixed: &str, holdout: bool, models: &dyn Fn(&str) -> String) -> CalibrationResult {
    let mut text = format!(
        "[robot]\nfile = \"robot.toml\"\n[estimate]\ndrawing = false\n{fixed}\n[[constraint]]\nkind = \"position\"\nname = \"s\"\n\
         frame = \"tracker\"\ntarget = \"s\"\ndata = \"DATA/motoman_leica/right_wide_2019.csv\"\n"
    );
    text += if holdout { HOLDOUT } else { "" };
    let robot = table("motoman_leica/nominal_right.json", models);
    calibrate(&[("robot.toml", robot), ("calibration.toml", text)])
}

/// The figures of `results_nongeometric.json`, on all rows, and what they are worth on rows held out.
fn motoman_wide_with_models() -> Result<(), Failed> {
    let reference = nominal("motoman_leica/results_nongeometric.json");
    let figure = |name: &str| reference[name]["rms_mm"].as_f64().unwrap();
    let none = |_: &str| String::new();
    let harmonics = |_: &str| String::from("\"gain\", \"harmonics(2)\"");
    let both = |joint: &str| {
        let gravity = match joint {
            "q_L" => ", \"gravity(4, 6)\"",
            "q_U" => ", \"gravity(6)\"",
            _ => "",
        };
        format!("\"gain\", \"harmonics(2)\"{gravity}")
    };
    let held = "fixed = [\"K*\"]";
    let trained = |result: &CalibrationResult| rms(&result.constraints).1;
    let digit = 0.000_1;
    let geometric = motoman_wide(held, false, &none);
    near("geometric", trained(&geometric), figure("None"), digit)?;
    near(
        "gains",
        trained(&motoman_wide("", false, &none)),
        figure("gain"),
        digit,
    )?;
    let found = trained(&motoman_wide(held, false, &harmonics));
    near("harmonics", found, figure("harm"), digit)?;
    let held_out = |result: &CalibrationResult| rms(&result.validation).1;
    let before = held_out(&motoman_wide(held, true, &none));
    near("geometric, held out", before, 2.294, 0.000_5)?;
    let after = held_out(&motoman_wide("", true, &both));
    less("gravity and harmonics, held out", after, 1.58)
}

/// A chain of a URDF as general frames.
fn urdf(path: &str) -> String {
    let json = nominal(path);
    let mut text = String::from("name = \"robot\"\nconvention = \"khalil-kleinfinger\"\n");
    for joint in json["joints"].as_array().unwrap() {
        let list = |key: &str| joint[key].to_string();
        let kind = joint["type"].as_str().unwrap();
        let name = joint["name"].as_str().unwrap();
        writeln!(
            text,
            "[[joint]]\nname = {name:?}\ntype = {kind:?}\nconvention = \"urdf\"\nxyz = {}\nrpy = {}",
            list("xyz"),
            list("rpy")
        )
        .unwrap();
        if kind != "fixed" {
            writeln!(text, "axis = {}", list("axis")).unwrap();
        }
    }
    text
}

/// Poses of a board by a camera, neither of which anybody measured: hand–eye and robot–world calibration.
fn ur10() -> Result<(), Failed> {
    // The README's angles are about fixed axes: R = Rz(φz) · Ry(φy) · Rx(φx).
    let path = data().join("ur10_figaroh/samples.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let mut csv = String::from(
        "x,y,z,qw,qx,qy,qz,shoulder_pan_joint,shoulder_lift_joint,elbow_joint,wrist_1_joint,wrist_2_joint,wrist_3_joint\n",
    );
    for line in text.lines().skip(1) {
        let n: Vec<f64> = line.split(',').map(|n| n.parse().unwrap()).collect();
        let turn = truing::nalgebra::UnitQuaternion::from_euler_angles(n[3], n[4], n[5]);
        let place = [n[0], n[1], n[2], turn.w, turn.i, turn.j, turn.k];
        let numbers = place.iter().chain(&n[6..]).map(f64::to_string);
        csv += &(numbers.collect::<Vec<_>>().join(",") + "\n");
    }
    let file = |holdout: &str| {
        let head = "[robot]\nfile = \"robot.toml\"\n[estimate]\ndrawing = false\nfixed = [\"gains\"]\n[[constraint]]\nkind = \"pose\"\n\
                    name = \"board\"\ndata = \"board.csv\"\nframe = \"camera\"\ntarget = \"board\"\n\
                    sigma = { position = \"1 mm\", rotation = \"10 mrad\" }\n";
        [
            ("robot.toml", urdf("ur10_figaroh/nominal.json")),
            ("board.csv", csv.clone()),
            ("calibration.toml", format!("{head}{holdout}")),
        ]
    };
    let result = calibrate(&file(""));
    let set = &result.constraints[0];
    let figures = |of: &Option<ErrorSummary>| {
        let of = of.as_ref().unwrap();
        (of.rms * 1e3, of.more["rotation"].rms.to_degrees())
    };
    let (position, rotation) = figures(&set.registered);
    near("registered [mm]", position, 3.46, 0.005)?;
    near("registered [deg]", rotation, 0.575, 0.000_5)?;
    let (position, rotation) = figures(&set.after);
    near("full [mm]", position, 2.71, 0.005)?;
    near("full [deg]", rotation, 0.518, 0.000_5)?;
    // Twenty-three camera poses do not support a full model: its prediction is worse, and it says so.
    let held_out = calibrate(&file(HOLDOUT));
    let (registered, after) = rms(&held_out.validation);
    println!("held out: registered {registered:.3}, full {after:.3} mm");
    assert!(after > registered);
    assert!(!held_out.trusted, "{:?}", held_out.warnings);
    Ok(())
}

/// Three markers on the hand, a lifting torso.
fn tiago() -> Result<(), Failed> {
    let file = |holdout: &str| {
        let mut text = String::from(
            "[robot]\nfile = \"robot.toml\"\n[estimate]\ndrawing = false\nfixed = [\"gains\"]\n",
        );
        for k in 1..=3 {
            write!(
                text,
                "[[constraint]]\nkind = \"position\"\nname = \"m{k}\"\ntarget = \"m{k}\"\nframe = \"mocap\"\n\
                 data = \"DATA/tiago_mocap/samples.csv\"\ncolumns = {{ x = \"x{k}\", y = \"y{k}\", z = \"z{k}\" }}\n{holdout}"
            )
            .unwrap();
        }
        [
            ("robot.toml", urdf("tiago_mocap/nominal.json")),
            ("calibration.toml", text),
        ]
    };
    let result = calibrate(&file(""));
    near("registered", rms(&result.constraints).0, 4.20, 0.005)?;
    let held_out = calibrate(&file(HOLDOUT));
    let (registered, after) = rms(&held_out.validation);
    println!("held out: registered {registered:.3}, full {after:.3} mm");
    assert!(after > registered);
    assert!(!held_out.trusted, "{:?}", held_out.warnings);
    Ok(())
}

fn main() -> ExitCode {
    let absent = !data().is_dir();
    if absent {
        let folder = data();
        eprintln!(
            "real data not found in {}: set TRUING_DATA; ignored",
            folder.display()
        );
    }
    let trial = |name: &str, run: fn() -> Result<(), Failed>| {
        Trial::test(name, run).with_ignored_flag(absent)
    };
    let tests = vec![
        trial("irb120_with_models", irb120_with_models),
        trial("motoman_wide_with_models", motoman_wide_with_models),
        trial("ur10", ur10),
        trial("tiago", tiago),
    ];
    libtest_mimic::run(&Arguments::from_args(), tests).exit_code()
}
