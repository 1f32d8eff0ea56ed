//! `truing calibrate` keeps its contract: what it reads, what it prints, what it writes and how it
//! exits.

#[path = "support/cell.rs"]
mod cell;

use cell::{Cell, JOINTS, Reading, cells, measure, positions, table, true_parameters};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use truing::manifold::Pose;
use truing::nalgebra::Vector3;
use truing_robot::Robot;
use truing_robot::robot::RobotFile;

/// The keys of an object, in order.
#[track_caller]
fn keys(object: &Value) -> Vec<&str> {
    let object = object.as_object().unwrap();
    object.keys().map(String::as_str).collect()
}

#[track_caller]
fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is not a number"))
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| number(&value[i]))
}

/// The parameter of a result with this name.
#[track_caller]
fn parameter<'r>(result: &'r Value, name: &str) -> &'r Value {
    let parameters = result["parameters"].as_array().unwrap();
    parameters.iter().find(|p| p["name"] == name).unwrap()
}

/// Estimates by name, of everything that is estimated.
fn estimates(result: &Value) -> BTreeMap<String, f64> {
    let parameters = result["parameters"].as_array().unwrap().iter();
    let estimated = parameters.filter(|p| p["status"] == "estimated");
    estimated
        .map(|p| {
            (
                p["name"].as_str().unwrap().to_owned(),
                number(&p["estimate"]),
            )
        })
        .collect()
}

/// How far two results are apart: the largest difference of an estimate \[m or rad\].
#[track_caller]
fn difference(a: &Value, b: &Value) -> f64 {
    let (a, b) = (estimates(a), estimates(b));
    assert!(a.keys().eq(b.keys()), "{a:?} and {b:?} estimate the same");
    a.values()
        .zip(b.values())
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

/// The length that moved most from nominal, measured in its standard deviation: name and change.
fn most_certain_length(result: &Value) -> (String, f64) {
    let parameters = result["parameters"].as_array().unwrap().iter();
    let moved = |p: &&Value| number(&p["estimate"]) - number(&p["nominal"]);
    let certain = |p: &&Value| moved(p).abs() / number(&p["sigma"]);
    let lengths = parameters.filter(|p| p["status"] == "estimated" && p["unit"] == "m");
    let most = lengths
        .max_by(|a, b| certain(a).total_cmp(&certain(b)))
        .unwrap();
    (most["name"].as_str().unwrap().to_owned(), moved(&most))
}

/// A cell with an `[estimate]` table.
fn with_estimate(lines: &str) -> Cell {
    let cell = Cell::new();
    let table = format!("[estimate]\n{lines}\n\n[[constraint]]");
    cell.edit("calibration.toml", "[[constraint]]", &table);
    cell
}

/// A cell with more lines for its constraint.
fn with_key(lines: &str) -> Cell {
    let cell = Cell::new();
    cell.append("calibration.toml", lines);
    cell
}

const SAVE: [&str; 4] = ["calibrate", "calibration.toml", "--output", "out"];

// What comes out.

#[test]
fn the_result_has_the_promised_fields() {
    let cell = with_estimate("bounds = { \"d*\" = \"5 mm\" }");
    cell.append("calibration.toml", "holdout = { every = 10, rows = [0] }\n");
    let run = cell.run(&SAVE);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let result: Value = serde_json::from_str(&cell.read("out/result.json")).unwrap();
    let mut fields = keys(&result);
    fields.sort_unstable();
    assert_eq!(
        fields,
        [
            "condition",
            "constraints",
            "correlations",
            "cost",
            "distances",
            "doubts",
            "drawing",
            "everywhere",
            "frames",
            "identifiable",
            "initial_cost",
            "iterations",
            "outliers",
            "parameters",
            "planes",
            "points",
            "sigma0",
            "statistics",
            "targets",
            "termination",
            "tools",
            "trusted",
            "validation",
            "warnings",
        ]
    );
    assert_eq!(
        keys(&result["termination"]),
        ["converged", "kind", "message"]
    );
    assert_eq!(result["termination"]["converged"], true);
    assert_eq!(result["trusted"], true);
    assert_eq!(result["warnings"], json!([]));
    assert!(number(&result["iterations"]) >= 1.0);
    assert!(number(&result["cost"]) < number(&result["initial_cost"]));
    let sigma0 = number(&result["sigma0"]);
    assert!((0.1..2.0).contains(&sigma0), "{sigma0}");
    for (sets, count) in [(&result["constraints"], 36), (&result["validation"], 4)] {
        assert_eq!(sets.as_array().unwrap().len(), 1);
        let set = &sets[0];
        assert_eq!(
            keys(set),
            [
                "after",
                "before",
                "count",
                "kind",
                "name",
                "registered",
                "rows",
                "unit"
            ]
        );
        assert_eq!(
            (&set["name"], &set["kind"]),
            (&json!("tracker"), &json!("position"))
        );
        assert_eq!(
            (&set["count"], &set["rows"]),
            (&json!(count), &json!(3 * count))
        );
        assert_eq!(set["unit"], "m");
        for state in ["before", "registered", "after"] {
            assert_eq!(keys(&set[state]), ["max", "mean", "rms"]);
            let [mean, rms, max] = ["mean", "rms", "max"].map(|key| number(&set[state][key]));
            assert!(mean <= rms && rms <= max, "{set}");
        }
        let [before, registered, after] =
            ["before", "registered", "after"].map(|state| number(&set[state]["rms"]));
        assert!(after < registered && after < before, "{set}");
        assert!(after < 1e-4, "{set}");
    }
    let parameters = result["parameters"].as_array().unwrap();
    assert_eq!(parameters.len(), cell.robot().parameters().len());
    for p in parameters {
        let estimated = p["status"] == "estimated";
        let mut expected = vec!["estimate", "name", "nominal", "sigma", "status", "unit"];
        if p["status"] == "regrouped" {
            expected.insert(1, "into");
        }
        assert_eq!(keys(p), expected);
        assert_eq!(p["sigma"].is_number(), estimated, "{p}");
        assert!(["m", "rad", "1"].contains(&p["unit"].as_str().unwrap()));
        assert!(estimated || p["estimate"] == p["nominal"], "{p}");
        let status = [
            "estimated",
            "fixed",
            "no-effect",
            "regrouped",
            "unexcited",
            "held",
        ];
        assert!(status.contains(&p["status"].as_str().unwrap()), "{p}");
    }
    assert_eq!(
        number(&result["identifiable"]),
        estimates(&result).len() as f64
    );
    assert!(number(&result["condition"]) >= 1.0);
    assert_eq!(result["planes"], json!([]));
}

/// A pose of a result: `position` and `quaternion` (w, x, y, z).
fn pose(value: &Value) -> Pose<f64> {
    Pose::from_quaternion(
        Vector3::from(numbers::<3>(&value["position"])),
        numbers::<4>(&value["quaternion"]),
    )
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

/// Postures in which the tool of a robot touches the plane normal · p = distance, exactly.
fn touches(robot: &Robot, parameters: &[f64], normal: [f64; 3], distance: f64) -> Vec<Reading> {
    let height = |q: &[f64]| {
        let tip = robot.forward(parameters, q).translation;
        tip.dot(&Vector3::from(normal)) - distance
    };
    let mut found = measure(robot, parameters, 60, 0.0, 5);
    found.retain_mut(|reading| {
        // Bisection on the shoulder.
        let mut at = |shoulder: f64| {
            reading.q[1] = shoulder;
            height(&reading.q)
        };
        let (mut lower, mut upper) = (-1.5, 1.5);
        let rising = at(upper) > 0.0;
        if rising == (at(lower) > 0.0) {
            return false;
        }
        for _ in 0..60 {
            let middle = 0.5 * (lower + upper);
            if (at(middle) > 0.0) == rising {
                upper = middle;
            } else {
                lower = middle;
            }
        }
        true
    });
    found
}

#[test]
fn the_files_predict_what_the_result_says() {
    // A tracker in its own frame sees a reflector beside the tool; the tool touches two planes.
    let cell = Cell::new();
    let robot = cell.robot();
    let truth = true_parameters(&robot, 1);
    let reflector = Vector3::new(0.05, -0.03, 0.04);
    let sensor = Pose::from_quaternion(Vector3::new(2.0, -1.0, 0.5), [0.5, 0.5, -0.5, 0.5]);
    let mut readings = cell.readings(40);
    for (k, reading) in readings.iter_mut().enumerate() {
        let seen = robot.forward(&truth, &reading.q).apply(&reflector);
        let off = Vector3::from([0, 1, 2].map(|i| 3e-5 * ((3 * k + i) as f64).sin()));
        reading.position = sensor.inverse().apply(&(seen + off)).into();
    }
    cell.write("tracker.csv", positions(&readings));
    cell.append(
        "calibration.toml",
        "target = \"reflector\"\nframe = \"tracker\"\n\n\
         [[constraint]]\nkind = \"unknown-plane\"\ndata = \"touches.csv\"\nsigma = \"0.05 mm\"\n",
    );
    let planes = [
        ("floor", [0.0, 0.0, 1.0], 0.3),
        ("wall", [0.6, 0.8, 0.0], 0.35),
    ];
    let mut touched = Vec::new();
    let mut csv = format!("{JOINTS},plane\n");
    for (name, normal, distance) in planes {
        for mut reading in touches(&robot, &truth, normal, distance) {
            reading.q[0] += 1e-4 * (touched.len() as f64).sin();
            csv += &format!("{},{name}\n", cells(&reading.q));
            touched.push((name, reading));
        }
    }
    cell.write("touches.csv", csv);

    let run = cell.run(&SAVE);
    assert_eq!(run.status, 0, "{}{}", run.stdout, run.stderr);
    let result: Value = serde_json::from_str(&cell.read("out/result.json")).unwrap();
    let file = RobotFile::read(cell.path("out/robot.toml")).unwrap();
    assert_eq!(file.name, "PUMA 560");
    let robot = Robot::new(&file);
    let nominal = robot.nominal();
    for (p, value) in robot.parameters().iter().zip(&nominal) {
        let estimate = number(&parameter(&result, &p.name)["estimate"]);
        assert!((estimate - value).abs() <= 1e-15, "{}", p.name);
    }

    let (frame, target) = (&result["frames"][0], &result["targets"][0]);
    assert_eq!(keys(frame), ["name", "position", "quaternion", "sigma"]);
    assert_eq!(keys(target), ["name", "position", "robot", "sigma"]);
    let (sensor, point) = (
        pose(frame),
        Vector3::from(numbers::<3>(&target["position"])),
    );
    let errors: Vec<f64> = readings
        .iter()
        .map(|r| {
            let seen = sensor.apply(&Vector3::from(r.position));
            (robot.forward(&nominal, &r.q).apply(&point) - seen).norm()
        })
        .collect();
    let after = number(&result["constraints"][0]["after"]["rms"]);
    approx::assert_relative_eq!(rms(&errors), after, max_relative = 1e-6);
    assert!(after < 1e-4);
    assert_eq!(result["constraints"][0]["before"], Value::Null);

    let mut errors = Vec::new();
    for plane in result["planes"].as_array().unwrap() {
        assert_eq!(
            keys(plane),
            ["constraint", "count", "distance", "group", "normal", "rms"]
        );
        let normal = Vector3::from(numbers::<3>(&plane["normal"]));
        let own = touched.iter().filter(|(name, _)| plane["group"] == *name);
        let own: Vec<f64> = own
            .map(|(_, r)| {
                let tip = robot.forward(&nominal, &r.q).translation;
                tip.dot(&normal) - number(&plane["distance"])
            })
            .collect();
        assert_eq!(own.len() as f64, number(&plane["count"]));
        approx::assert_relative_eq!(rms(&own), number(&plane["rms"]), max_relative = 1e-6);
        errors.extend(own);
    }
    assert_eq!(errors.len(), touched.len());
    let after = number(&result["constraints"][1]["after"]["rms"]);
    approx::assert_relative_eq!(rms(&errors), after, max_relative = 1e-6);
}

#[test]
fn json_on_standard_output_is_the_file_and_text_goes_to_standard_error() {
    let cell = Cell::new();
    let run = cell.run(&[&SAVE[..], &["--json"]].concat());
    assert_eq!(run.status, 0, "{}", run.stderr);
    assert_eq!(run.stdout, cell.read("out/result.json"));
    assert!(run.stderr.contains("Parameters"), "{}", run.stderr);
    let plain = cell.run(&["calibrate", "calibration.toml"]);
    assert_eq!(plain.stderr, "");
    assert!(run.stderr.starts_with(&plain.stdout), "{}", plain.stdout);
}

#[test]
fn text_that_no_terminal_shows_has_no_colours() {
    let cell = Cell::new();
    for arguments in [&SAVE[..], &["calibrate", "missing.toml"], &["--help"]] {
        let run = cell.run(&[arguments, &["-vv"]].concat());
        assert!(!run.stdout.contains('\u{1b}'), "{}", run.stdout);
        assert!(!run.stderr.contains('\u{1b}'), "{}", run.stderr);
    }
}

// How it exits, and what it writes.

#[test]
fn a_result_that_did_not_converge_exits_with_1_and_is_not_written() {
    let cell = with_estimate("max_iterations = 1");
    let run = cell.run(&SAVE);
    assert_eq!(run.status, 1, "{}", run.stderr);
    assert!(
        run.stdout.contains("not converged: 1 iterations"),
        "{}",
        run.stdout
    );
    assert!(run.stdout.contains("--keep-untrusted"), "{}", run.stdout);
    assert!(!cell.path("out").exists());

    let run = cell.run(&[&SAVE[..], &["--keep-untrusted", "--json"]].concat());
    assert_eq!(run.status, 1);
    assert_eq!(run.json()["trusted"], false);
    assert_eq!(run.json()["termination"]["kind"], "max-iterations");
    assert_eq!(cell.read("out/result.json"), run.stdout);
    assert!(RobotFile::read(cell.path("out/robot.toml")).is_ok());
    let run = cell.run(&[&SAVE[..], &["--force"]].concat());
    assert_eq!(run.status, 1);
    assert!(cell.read("out/robot.toml").contains("NOT TO BE TRUSTED"));
}

#[test]
fn a_result_that_must_not_be_trusted_exits_with_1_and_says_why() {
    // Postures in the open air are no touches of a plane: only an arm without lengths fits them.
    let cell = Cell::new();
    cell.edit("calibration.toml", "\"position\"", "\"unknown-plane\"");
    let run = cell.run(&[&SAVE[..], &["--json"]].concat());
    assert_eq!(run.status, 1, "{}", run.stderr);
    let result = run.json();
    assert_eq!(result["trusted"], false);
    let warnings = result["warnings"].as_array().unwrap();
    let said = warnings
        .iter()
        .any(|w| w.as_str().unwrap().starts_with("not to be trusted"));
    assert!(
        said || result["termination"]["converged"] == false,
        "{}",
        run.stderr
    );
    assert!(!cell.path("out").exists());
}

#[test]
fn wrong_arguments_exit_with_2() {
    let cell = Cell::new();
    for arguments in [
        &["calibrate"][..],
        &["calibrat", "calibration.toml"],
        &["calibrate", "calibration.toml", "--timeout", "0"],
        &["calibrate", "calibration.toml", "--colour"],
    ] {
        let run = cell.run(arguments);
        assert_eq!((run.status, run.stdout.as_str()), (2, ""));
        assert!(run.stderr.contains("--help"), "{}", run.stderr);
    }
    assert_eq!(cell.run(&["--help"]).status, 0);
}

#[test]
fn a_folder_is_made_filled_when_empty_and_overwritten_only_by_force() {
    let cell = Cell::new();
    let deep = ["calibrate", "calibration.toml", "--output", "a/b/c"];
    assert_eq!(cell.run(&deep).status, 0);
    assert!(cell.path("a/b/c/robot.toml").exists());

    std::fs::create_dir(cell.path("out")).unwrap();
    assert_eq!(cell.run(&SAVE).status, 0);
    let first = cell.read("out/robot.toml");
    assert_eq!(cell.run(&SAVE).status, 2);

    cell.write("out/notes.txt", "mine");
    cell.edit(
        "calibration.toml",
        "[robot]",
        "estimate.fixed = [\"d3\"]\n[robot]",
    );
    assert_eq!(cell.run(&SAVE).status, 2);
    assert_eq!(cell.read("out/robot.toml"), first);
    let run = cell.run(&[&SAVE[..], &["--force"]].concat());
    assert_eq!(run.status, 0, "{}", run.stderr);
    assert_ne!(cell.read("out/robot.toml"), first);
    assert_eq!(cell.read("out/notes.txt"), "mine");
    let mut names: Vec<_> = std::fs::read_dir(cell.path("out"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "notes.txt",
            "report.html",
            "residuals.csv",
            "result.json",
            "robot.toml"
        ]
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_with_the_best_point_and_writes_nothing() {
    use std::io::{BufRead, BufReader, Read};
    use std::process::{Command, Stdio};

    // Slow enough to be stopped: every step differentiates 2000 rows numerically.
    let cell = with_estimate("jacobian = \"numeric\"");
    cell.write("tracker.csv", positions(&cell.readings(2000)));
    let before = cell.files();
    let mut child = cell
        .command(&[&SAVE[..], &["-v"]].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap());
    let mut line = String::new();
    while !line.trim_end().ends_with(" estimating") {
        line.clear();
        let length = said.read_line(&mut line).unwrap();
        assert!(length > 0, "it says when it begins to estimate");
    }
    let id = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &id]).status().unwrap();
    assert!(sent.success());

    let mut stdout = String::new();
    child
        .stdout
        .take()
        .unwrap()
        .read_to_string(&mut stdout)
        .unwrap();
    said.read_to_string(&mut line).unwrap();
    let status = child.wait().unwrap();
    assert_eq!(status.code(), Some(1), "{stdout}{line}");
    assert!(
        stdout.contains("interrupted; the best point so far"),
        "{stdout}"
    );
    assert!(stdout.contains("theta2"), "the point is printed: {stdout}");
    assert!(stdout.contains("nothing written to out"), "{stdout}");
    assert_eq!(cell.files(), before);
}

// What it reads.

#[test]
fn degrees_and_millimetres_give_the_answer_of_radians_and_metres() {
    let cell = Cell::new();
    let reference = cell.calibrate();
    let readings = cell.readings(40);
    let in_units = |r: &Reading| {
        let degrees = r.q.iter().map(|q| q.to_degrees());
        degrees.chain(r.position.map(|x| 1e3 * x)).collect()
    };
    let header = format!(
        "{} [deg],x [mm],y [mm],z [mm]",
        JOINTS.replace(',', " [deg],")
    );
    cell.write("tracker.csv", table(&header, &readings, in_units));
    let by_header = cell.calibrate();
    assert!(difference(&by_header, &reference) < 1e-9);

    cell.write(
        "tracker.csv",
        table(&format!("{JOINTS},x,y,z"), &readings, in_units),
    );
    let units = "units = { angle = \"deg\", length = \"mm\" }\n";
    cell.append("calibration.toml", units);
    let by_table = cell.calibrate();
    assert_eq!(by_table["parameters"], by_header["parameters"]);

    // What the header says goes before the table.
    cell.write("tracker.csv", {
        let header = format!("{JOINTS},x [m],y [m],z [m]");
        table(&header, &readings, |r| {
            let degrees = r.q.iter().map(|q| q.to_degrees());
            degrees.chain(r.position).collect()
        })
    });
    assert!(difference(&cell.calibrate(), &reference) < 1e-9);
}

#[test]
fn columns_are_found_by_joint_by_number_and_by_map() {
    let cell = Cell::new();
    let reference = cell.calibrate();
    let rename = |from: &str, to: &str| cell.edit("tracker.csv", from, to);
    rename(JOINTS, "q1,q2,q3,q4,q5,q6");
    assert_eq!(cell.calibrate(), reference);
    rename("q1,q2,q3,q4,q5,q6,x,y,z", "A,q2,q3,q4,q5,q6,s1x,s1y,s1z");
    cell.append(
        "calibration.toml",
        "columns = { waist = \"A\", x = \"s1x\", y = \"s1y\", z = \"s1z\" }\n",
    );
    assert_eq!(cell.calibrate(), reference);
}

#[test]
fn a_parked_joint_takes_its_value_from_the_robot() {
    let cell = Cell::new();
    let robot = cell.robot();
    let truth = true_parameters(&robot, 1);
    let mut readings = cell.readings(40);
    for reading in &mut readings {
        reading.q[5] = 0.3;
        reading.position = robot.forward(&truth, &reading.q).translation.into();
    }
    cell.write("tracker.csv", positions(&readings));
    let reference = cell.calibrate();
    let without = JOINTS.strip_suffix(",yaw").unwrap();
    let row = |r: &Reading| [&r.q[..5], &r.position].concat();
    cell.write(
        "tracker.csv",
        table(&format!("{without},x,y,z"), &readings, row),
    );
    let parked = format!("name = \"yaw\"\nvalue = {:?}", 0.3f64.to_degrees());
    cell.edit("robot.toml", "name = \"yaw\"", &parked);
    assert!(difference(&cell.calibrate(), &reference) < 1e-12);
}

#[test]
fn rows_are_chosen_by_range_and_by_condition() {
    let cell = Cell::new();
    let rows = cell.read("tracker.csv");
    let first: Vec<&str> = rows.lines().take(26).collect();
    cell.write("tracker.csv", first.join("\n"));
    let reference = cell.calibrate();
    for (selection, count) in [
        ("0:25", 25),
        (":-15", 25),
        ("day == 'monday'", 25),
        ("not (day == 'tuesday')", 25),
        ("day == 'monday' and rep == 1", 13),
        ("day != 'monday' or rep == 0", 27),
        ("rep >= 0 and rep < 2", 40),
    ] {
        let cell = with_key(&format!("rows = \"{selection}\"\n"));
        cell.write("tracker.csv", marked_rows(&rows));
        let result = cell.calibrate();
        assert_eq!(result["constraints"][0]["count"], count, "{selection}");
        if count == 25 {
            assert_eq!(result["parameters"], reference["parameters"]);
        }
    }
}

/// Rows 0 … 24 are of Monday, the rest of Tuesday, `rep` 1, 0, 1, …
fn marked_rows(rows: &str) -> String {
    let marked = rows.lines().enumerate().map(|(k, line)| match k {
        0 => format!("{line},day,rep\n"),
        1..=25 => format!("{line},monday,{}\n", k % 2),
        _ => format!("{line},tuesday,{}\n", k % 2),
    });
    marked.collect()
}

#[test]
fn rows_held_out_are_reported_and_not_used() {
    let cell = with_key("holdout = { every = 10, rows = [0, 3, 7] }\n");
    let held = cell.calibrate();
    assert_eq!(held["constraints"][0]["count"], 28);
    assert_eq!(held["validation"][0]["count"], 12);
    let text = cell.read("tracker.csv");
    let used = text.lines().enumerate();
    let used = used.filter(|(k, _)| *k == 0 || ![0, 3, 7].contains(&((k - 1) % 10)));
    let used: Vec<&str> = used.map(|(_, line)| line).collect();
    let only = Cell::new();
    only.write("tracker.csv", used.join("\n"));
    assert_eq!(only.calibrate()["parameters"], held["parameters"]);
}

#[test]
fn data_to_validate_with_are_reported_and_not_used() {
    let cell = Cell::new();
    let alone = cell.calibrate();
    let robot = cell.robot();
    let others = measure(&robot, &true_parameters(&robot, 1), 30, 5e-5, 99);
    cell.write("others.csv", positions(&others));
    cell.append(
        "calibration.toml",
        "\n[[validate]]\nkind = \"position\"\ndata = \"others.csv\"\n",
    );
    let validated = cell.calibrate();
    assert_eq!(validated["parameters"], alone["parameters"]);
    let set = &validated["validation"][0];
    assert_eq!(
        (&set["name"], &set["count"]),
        (&json!("others"), &json!(30))
    );
    assert!(number(&set["after"]["rms"]) < 0.1 * number(&set["registered"]["rms"]));
}

#[test]
fn groups_with_too_few_rows_are_left_out_with_a_word() {
    let cell = Cell::new();
    let robot = cell.robot();
    let truth = true_parameters(&robot, 1);
    let mut csv = format!("{JOINTS},plane\n");
    let floor = touches(&robot, &truth, [0.0, 0.0, 1.0], 0.3);
    for (k, touch) in floor.iter().enumerate() {
        let plane = if k < 2 { "step" } else { "floor" };
        csv += &format!("{},{plane}\n", cells(&touch.q));
    }
    cell.write("touches.csv", csv);
    cell.append(
        "calibration.toml",
        "\n[[constraint]]\nkind = \"unknown-plane\"\ndata = \"touches.csv\"\n",
    );
    let result = cell.calibrate();
    let warning = result["warnings"][0].as_str().unwrap();
    assert!(warning.contains("plane `step` has 2 touches"), "{warning}");
    assert!(warning.contains("left out"), "{warning}");
    assert_eq!(result["constraints"][1]["count"], floor.len() - 2);
    assert_eq!(result["planes"].as_array().unwrap().len(), 1);
}

// What it estimates.

#[test]
fn an_active_bound_is_kept_and_said() {
    let free = Cell::new().calibrate();
    let (name, moved) = most_certain_length(&free);
    let bound = 0.5 * moved.abs();
    let bounded = with_estimate(&format!("bounds = {{ {name} = {bound:?} }}")).calibrate();
    let p = parameter(&bounded, &name);
    let side = if moved > 0.0 { "upper" } else { "lower" };
    assert_eq!(p["at_bound"], side);
    let moved = number(&p["estimate"]) - number(&p["nominal"]);
    assert!(
        moved.abs() <= bound * (1.0 + 1e-12),
        "{moved} is outside ±{bound}"
    );
    assert!(number(&bounded["cost"]) > number(&free["cost"]));

    // The same as an interval.
    let nominal = number(&p["nominal"]);
    let (lower, upper) = (nominal - bound, nominal + bound);
    let interval = format!("bounds = {{ {name} = [{lower:?}, {upper:?}] }}");
    assert!(difference(&with_estimate(&interval).calibrate(), &bounded) < 1e-9);

    let wide = with_estimate(&format!("bounds = {{ {name} = 1.0 }}")).calibrate();
    assert!(parameter(&wide, &name)["at_bound"].is_null());
    assert!(difference(&wide, &free) < 1e-9);
}

#[test]
fn every_solver_finds_the_same_robot() {
    let reference = Cell::new().calibrate();
    for solver in ["gauss-newton", "line-search", "dogleg"] {
        let found = with_estimate(&format!("solver = {solver:?}")).calibrate();
        assert!(difference(&found, &reference) < 1e-9, "{solver}");
    }
}

#[test]
fn a_prior_pulls_towards_nominal() {
    let free = Cell::new().calibrate();
    let (name, moved) = most_certain_length(&free);
    let sigma = number(&parameter(&free, &name)["sigma"]);
    let change = |prior: f64| {
        let result = with_estimate(&format!("prior = {{ {name} = {prior:?} }}")).calibrate();
        let p = parameter(&result, &name);
        (number(&p["estimate"]) - number(&p["nominal"])) / moved
    };
    let [strong, even, weak] = [1e-3 * sigma, sigma, 1e4 * sigma].map(change);
    assert!(strong.abs() < 1e-3, "{strong}");
    assert!((0.05..0.95).contains(&even), "{even}");
    assert!((weak - 1.0).abs() < 1e-3, "{weak}");
}

#[test]
fn preference_decides_which_of_a_group_is_estimated() {
    let cell = Cell::new();
    let reference = cell.calibrate();
    let parameters = reference["parameters"].as_array().unwrap();
    let regrouped = parameters
        .iter()
        .find(|p| p["status"] == "regrouped")
        .unwrap();
    let name = regrouped["name"].as_str().unwrap();
    let preferred = with_estimate(&format!("preference = [\"{name}\"]")).calibrate();
    assert_eq!(parameter(&preferred, name)["status"], "estimated");
    let into = regrouped["into"].as_array().unwrap();
    let now = |p: &Value| parameter(&preferred, p[0].as_str().unwrap())["status"].clone();
    assert!(into.iter().any(|p| now(p) == "regrouped"), "{preferred:#}");
    // The same robot, said with other parameters.
    assert_eq!(preferred["identifiable"], reference["identifiable"]);
    let [a, b] = [&reference, &preferred].map(|r| number(&r["constraints"][0]["after"]["rms"]));
    approx::assert_relative_eq!(a, b, max_relative = 1e-4);
}

#[test]
fn fixed_parameters_stay_nominal() {
    let cell = with_estimate("parameters = [\"all\"]\nfixed = [\"theta*\", \"gains\"]");
    let result = cell.calibrate();
    for p in result["parameters"].as_array().unwrap() {
        let name = p["name"].as_str().unwrap();
        let fixed = name.starts_with("theta") || name.starts_with('K');
        assert_eq!(p["status"] == "fixed", fixed, "{p}");
    }
}

/// Positions with a column `sigma`, and the position of one reading off by `off` \[m\].
fn with_outlier(cell: &Cell, off: f64, sigma: impl Fn(usize) -> f64) -> String {
    let mut readings = cell.readings(40);
    readings[7].position[2] += off;
    let mut csv = format!("{JOINTS},x,y,z,sigma\n");
    for (k, r) in readings.iter().enumerate() {
        csv += &format!(
            "{}\n",
            cells(&[&r.q[..], &r.position, &[sigma(k)]].concat())
        );
    }
    csv
}

#[test]
fn a_standard_deviation_a_row_weighs_that_row() {
    let cell = Cell::new();
    // What is held near nominal depends a little on all of the noise.
    cell.edit(
        "calibration.toml",
        "[[constraint]]",
        "[estimate]\ndrawing = false\n\n[[constraint]]",
    );
    let clean = cell.calibrate();
    cell.write("tracker.csv", with_outlier(&cell, 0.0, |_| 5e-5));
    assert_eq!(cell.calibrate()["parameters"], clean["parameters"]);
    cell.write("tracker.csv", with_outlier(&cell, 0.05, |_| 5e-5));
    let spoilt = cell.distrusted();
    cell.write(
        "tracker.csv",
        with_outlier(&cell, 0.05, |k| if k == 7 { 1e3 } else { 5e-5 }),
    );
    let weighed = cell.calibrate();
    let text = cell.read("tracker.csv");
    let rows: Vec<&str> = text
        .lines()
        .enumerate()
        .filter(|(k, _)| *k != 8)
        .map(|(_, l)| l)
        .collect();
    cell.write("tracker.csv", rows.join("\n"));
    let without = cell.calibrate();
    assert!(difference(&weighed, &without) < 1e-9);
    assert!(difference(&spoilt, &without) > 1e-4);
}

#[test]
fn a_robust_loss_is_not_drawn_by_a_gross_outlier() {
    let cell = Cell::new();
    let clean = cell.calibrate();
    cell.write("tracker.csv", with_outlier(&cell, 0.05, |_| 5e-5));
    let squared = cell.distrusted();
    cell.append("calibration.toml", "loss = \"huber(1.5)\"\n");
    let robust = cell.calibrate();
    let (squared, robust) = (difference(&squared, &clean), difference(&robust, &clean));
    assert!(robust < 0.05 * squared, "{robust} against {squared}");
}

/// Outliers are named by the rows and lines of their file, whichever rows are used and held out, in the
/// result, in the text and in the report; without a robust loss nothing is.
#[test]
fn outliers_are_named_by_their_rows() {
    let cell = Cell::new();
    cell.write("tracker.csv", with_outlier(&cell, 0.05, |_| 5e-5));
    let plain = cell.run(&["calibrate", "calibration.toml"]);
    assert!(!plain.stdout.contains("Outliers"), "{}", plain.stdout);
    cell.append(
        "calibration.toml",
        "loss = \"tukey\"\nrows = \"3:\"\nholdout = { every = 10, rows = [1] }\n",
    );
    let run = cell.run(&[&SAVE[..], &["--json"]].concat());
    assert_eq!(run.status, 0, "{}", run.stderr);
    let result = run.json();
    let outliers = result["outliers"].as_array().unwrap();
    let [outlier] = &outliers[..] else {
        panic!("{outliers:?}");
    };
    assert_eq!(outlier["constraint"], "tracker");
    assert_eq!((&outlier["row"], &outlier["line"]), (&7.into(), &9.into()));
    assert!((number(&outlier["error"]) - 0.05).abs() < 1e-3, "{outlier}");
    assert_eq!(number(&outlier["weight"]), 0.0);
    for text in [run.stderr, cell.read("out/report.html")] {
        assert!(
            text.contains("tracker: 1 of 33, without them rms 0.0"),
            "{text}"
        );
        assert!(text.contains("row 7 (line 9) 50."), "{text}");
    }
}

#[test]
fn all_ways_of_differentiating_and_solving_agree() {
    let reference = Cell::new().calibrate();
    for lines in [
        "jacobian = \"whole-chain\"",
        "jacobian = \"numeric\"",
        "solver = \"gauss-newton\"",
    ] {
        let other = with_estimate(lines).calibrate();
        assert!(difference(&other, &reference) < 1e-8, "{lines}");
    }
}

#[test]
fn two_robots_are_written_to_two_files() {
    let cell = Cell::new();
    cell.write(
        "calibration.toml",
        "[robots.left]\nfile = \"robot.toml\"\n[robots.right]\nfile = \"robot.toml\"\n\
         [[constraint]]\nkind = \"position\"\ndata = \"tracker.csv\"\nrobot = \"left\"\n\
         [[constraint]]\nkind = \"position\"\ndata = \"tracker.csv\"\nrobot = \"right\"\n",
    );
    let run = cell.run(&[&SAVE[..], &["--json"]].concat());
    assert_eq!(run.status, 0, "{}", run.stderr);
    let result = run.json();
    let estimate = |name: &str| number(&parameter(&result, name)["estimate"]);
    assert!((estimate("left.theta2") - estimate("right.theta2")).abs() < 1e-9);
    for name in ["robot-left.toml", "robot-right.toml"] {
        assert!(RobotFile::read(cell.path("out").join(name)).is_ok());
    }
}

/// The statistics of result.json and residuals.csv are those of the residuals, as they can be computed
/// again from the files.
#[test]
fn what_is_said_of_the_residuals_follows_from_the_files() {
    let cell = with_key("name = \"laser, \\\"long\\\"\"\nholdout = { every = 10, rows = [0] }\n");
    // Priors take shares of the unknowns.
    cell.edit(
        "calibration.toml",
        "[[constraint]]",
        "[estimate]\ndrawing = false\n\n[[constraint]]",
    );
    let run = cell.run(&SAVE);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let result: Value = serde_json::from_str(&cell.read("out/result.json")).unwrap();
    let text = cell.read("out/residuals.csv");
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "constraint,row,file,line,values,error,standardised,p_value,leverage,cook,tool_sigma"
    );
    let rows: Vec<Vec<&str>> = lines
        .map(|line| {
            let cells = line.strip_prefix("\"laser, \"\"long\"\"\",").unwrap();
            cells.split(',').collect()
        })
        .collect();
    assert_eq!(rows.len(), 36, "those held out are not in it");
    // Readings 0, 10, … are held out; the first is on line 2.
    assert_eq!(rows[0][..4], ["1", "tracker.csv", "3", "3"]);
    assert_eq!(rows[9][..4], ["11", "tracker.csv", "13", "3"]);
    let column = |k: usize| -> Vec<f64> {
        let cells = rows.iter().map(|row| row[k].parse().unwrap());
        cells.collect()
    };
    let statistics = &result["statistics"];
    let errors: Vec<f64> = column(4);
    let square: f64 = errors.iter().map(|e| (e / 5e-5).powi(2)).sum();
    assert!((square / number(&statistics["chi_square"]) - 1.0).abs() < 1e-9);
    let freedom = number(&statistics["degrees_of_freedom"]);
    let unknowns = estimates(&result).len() as f64;
    assert!((freedom - (3.0 * 36.0 - unknowns)).abs() < 1e-9);
    assert!((column(7).iter().sum::<f64>() - unknowns).abs() < 1e-8);
    let sigma0 = (square / freedom).sqrt();
    assert!((number(&statistics["sigma0"]) / sigma0 - 1.0).abs() < 1e-9);
    assert_eq!(number(&statistics["level"]), 0.05);
    let [large, small, p] =
        ["p_too_large", "p_too_small", "p_value"].map(|key| number(&statistics[key]));
    assert!((large + small - 1.0).abs() < 1e-9 && (p - 2.0 * large.min(small)).abs() < 1e-12);
    let tool = &result["tools"][0];
    let sigmas = column(9);
    let worst = sigmas.iter().copied().fold(0.0, f64::max);
    assert!((number(&tool["worst"]) / worst - 1.0).abs() < 1e-9);
    let of_file = tool["row"].to_string();
    let row = rows.iter().position(|cells| cells[0] == of_file).unwrap();
    assert!((sigmas[row] / worst - 1.0).abs() < 1e-9);
    assert_eq!(tool["line"].to_string(), rows[row][2]);
    assert!(
        run.stdout
            .contains(&format!("at line {} of tracker.csv", rows[row][2]))
    );
    assert!(run.stdout.contains("degrees of freedom, p = "));
}

/// A reading that is two millimetres off is named, in the text, the files and the report.
#[test]
fn a_wrong_reading_is_named() {
    let cell = Cell::new();
    let mut readings = cell.readings(40);
    readings[6].position[1] += 0.002;
    cell.write("tracker.csv", positions(&readings));
    let run = cell.run(&SAVE);
    let result: Value = serde_json::from_str(&cell.read("out/result.json")).unwrap();
    let outliers = result["outliers"].as_array().unwrap();
    assert_eq!(outliers.len(), 1);
    assert_eq!(
        (&outliers[0]["row"], &outliers[0]["line"]),
        (&json!(6), &json!(8))
    );
    assert_eq!(result["statistics"]["verdict"], "too-large");
    let text = "1 measurement is farther off than chance explains: line 8 of tracker.csv";
    assert!(run.stdout.contains(text), "{}", run.stdout);
    let page = cell.read("out/report.html");
    assert!(page.contains(text) && page.contains("How sure it is"));
}

/// The report is one file that loads nothing and runs nothing, has a plot for every set and for the
/// rows held out of it, and shows names as they are written, whatever they are made of.
#[test]
fn the_report_is_a_page_that_needs_nothing_else() {
    let cell = with_key("name = \"<b>tracker</b> & co\"\nholdout = { every = 4, rows = [1] }\n");
    let run = cell.run(&["calibrate", "calibration.toml", "--output", "out"]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let page = cell.read("out/report.html");
    assert_eq!(page.matches("<svg").count(), 2, "used and held out");
    assert!(page.contains("&lt;b&gt;tracker&lt;&#x2f;b&gt; &amp; co"));
    assert!(!page.contains("<b>tracker"));
    let outside = ["<script", "<link", "<img", "src=", "@import", "url("];
    for loads in outside {
        assert!(!page.contains(loads), "the page has `{loads}`");
    }
    let result: Value = serde_json::from_str(&cell.read("out/result.json")).unwrap();
    for p in result["parameters"].as_array().unwrap() {
        let name = p["name"].as_str().unwrap();
        assert!(page.contains(&format!(">{name}</td>")), "{name}");
    }
}
