//! `truing identify` keeps its contract: the JSON it prints, what it says to people, how it refuses.

#[path = "support/cell.rs"]
mod cell;

use cell::{Cell, Run};
use serde_json::Value;

/// Runs `truing identify … --json`; exit status 0.
#[track_caller]
fn json(cell: &Cell, arguments: &[&str]) -> Value {
    let run = cell.run(&[&["identify"], arguments, &["--json"]].concat());
    assert_eq!(run.status, 0, "{}", run.stderr);
    run.json()
}

/// Runs `truing identify …`; exit status 0, everything on standard output.
#[track_caller]
fn text(cell: &Cell, arguments: &[&str]) -> String {
    let run = cell.run(&[&["identify"], arguments].concat());
    assert_eq!(run.status, 0, "{}", run.stderr);
    assert_eq!(run.stderr, "");
    run.stdout
}

/// Runs `truing identify …`; exit status 2 and these words.
#[track_caller]
fn refused(cell: &Cell, arguments: &[&str], words: &[&str]) -> Run {
    let run = cell.run(&[&["identify"], arguments].concat());
    assert_eq!(run.status, 2, "{arguments:?}");
    assert_eq!(run.stdout, "");
    for word in words {
        assert!(run.stderr.contains(word), "{word} in {}", run.stderr);
    }
    run
}

fn names<'a>(answer: &'a Value, status: &str) -> Vec<&'a str> {
    let parameters = answer["parameters"].as_array().unwrap().iter();
    let same = parameters.filter(|p| p["status"] == status);
    same.map(|p| p["name"].as_str().unwrap()).collect()
}

#[test]
fn a_known_plane_answers_the_contract() {
    let cell = Cell::new();
    let answer = json(&cell, &["robot.toml", "--kind", "known-plane"]);
    assert_eq!(
        (&answer["columns"], &answer["rank"]),
        (&31.into(), &23.into())
    );
    let values = answer["singular_values"].as_array().unwrap();
    assert_eq!(values.len(), 31);
    let symmetries = answer["symmetries"].as_array().unwrap();
    assert_eq!(symmetries.len(), 4);
    assert_eq!(symmetries[3], "scale");
    for index in ["O1", "O2", "O3", "O4", "O5"] {
        assert!(answer["observability"][index].as_f64().unwrap() > 0.0);
    }
    assert_eq!(answer["gap"]["last_kept"], values[22]);
    assert!(
        answer["gap"]["ratio"]
            .as_f64()
            .is_none_or(|ratio| ratio > 1e6)
    );
    assert_eq!(names(&answer, "estimated").len(), 23);
    assert_eq!(names(&answer, "fixed").len(), 6);
    assert_eq!(names(&answer, "held"), ["r6"]);
    let parameters = answer["parameters"].as_array().unwrap();
    let r3 = parameters.iter().find(|p| p["name"] == "r3").unwrap();
    assert_eq!(r3["status"], "regrouped");
    assert_eq!(r3["into"][0][0], "r2");
    assert!((r3["into"][0][1].as_f64().unwrap() - 1.0).abs() < 1e-9);
    assert!(answer["scaling"]["singular_values"].is_string());
    assert!(answer["data"].is_null());
}

#[test]
fn people_read_words() {
    let cell = Cell::new();
    let said = text(&cell, &["robot.toml", "--kind", "unknown-plane"]);
    for words in [
        "20 of 31 parameters can be identified",
        "3 translations, 3 rotations, scale; the robot moves with unknown-plane",
        "  estimated (20)  ",
        "  no effect (1)   theta7\n",
        "  regrouped (3)   r3, alpha7, r7\n",
        "  held (7)        theta0, r0, alpha1, d1, theta1, r1, r6\n",
        "  r3      +1 r2\n",
        "singular values (31)",
        "the last that counts is",
        "O1 ",
    ] {
        assert!(said.contains(words), "{words} in {said}");
    }
    // With JSON the same words go to standard error.
    let run = cell.run(&[
        "identify",
        "robot.toml",
        "--kind",
        "unknown-plane",
        "--json",
    ]);
    assert_eq!(run.stderr, said);
}

#[test]
fn several_kinds_and_planes_say_what_each_adds() {
    let cell = Cell::new();
    let arguments = [
        "robot.toml",
        "--plane",
        "0,0,2,0.8",
        "--plane=-1,0,0,-0.3",
        "--planes",
        "2",
        "--kind",
        "position",
    ];
    let answer = json(&cell, &arguments);
    let steps = answer["steps"].as_array().unwrap();
    let step = |k: usize| {
        let step: &Value = &steps[k];
        (
            step["constraint"].as_str().unwrap(),
            step["rank"].as_u64().unwrap(),
        )
    };
    let all: Vec<_> = (0..steps.len()).map(step).collect();
    let expected = [
        ("position", 27),
        ("known-plane-1", 27),
        ("known-plane-2", 27),
        ("unknown-plane-1", 27),
        ("unknown-plane-2", 27),
    ];
    assert_eq!(all, expected);
    let said = text(&cell, &arguments[..4]);
    assert!(said.contains("What each constraint adds"), "{said}");
    assert!(said.contains("known-plane-2    +2    25"), "{said}");
    let random = json(
        &cell,
        &["robot.toml", "--kind", "known-plane", "--planes", "3"],
    );
    assert_eq!(random["rank"], 26);
}

#[test]
fn parameters_and_preference_are_the_users() {
    let cell = Cell::new();
    let position = ["robot.toml", "--kind", "position"];
    let ask = |more: &[&str]| json(&cell, &[&position, more].concat());
    assert_eq!(ask(&["--parameters", "all"])["rank"], 33);
    let tool = ask(&["--parameters", "tool", "theta6"]);
    assert_eq!((&tool["columns"], &tool["rank"]), (&5.into(), &3.into()));
    let fixed = ask(&["--fixed", "base", "--fixed", "beta*"]);
    assert_eq!(
        (&fixed["columns"], &fixed["rank"]),
        (&24.into(), &20.into())
    );
    let preferred = ask(&["--preference", "r3"]);
    assert!(names(&preferred, "regrouped").contains(&"r2"));
    let one = ask(&["--seed", "5"]);
    assert_eq!(one, ask(&["--seed", "5"]));
    assert_ne!(one["singular_values"], ask(&[])["singular_values"]);
    let tracked = ask(&["--frame", "tracker", "--target", "ball"]);
    assert_eq!(
        (&tracked["columns"], &tracked["rank"]),
        (&40.into(), &27.into())
    );
    assert_eq!(tracked["rank_of"]["frames"], 6);
}

#[test]
fn a_calibration_is_asked_with_its_data() {
    let cell = Cell::new();
    let answer = json(&cell, &["calibration.toml"]);
    assert_eq!(
        (&answer["columns"], &answer["rank"]),
        (&37.into(), &33.into())
    );
    let data = &answer["data"];
    assert_eq!(
        (&data["measurements"], &data["rank"]),
        (&40.into(), &33.into())
    );
    assert_eq!(data["unexcited"].as_array().unwrap().len(), 0);
    let said = text(&cell, &["calibration.toml"]);
    assert!(
        said.contains("determine all 33 that the structure allows"),
        "{said}"
    );
    assert!(
        said.contains("at the data's configurations (40 measurements)"),
        "{said}"
    );
    // The preference of the file counts.
    cell.append(
        "calibration.toml",
        "[estimate]\npreference = [\"r3\"]\nfixed = [\"gains\"]\n",
    );
    let answer = json(&cell, &["calibration.toml"]);
    assert!(names(&answer, "regrouped").contains(&"r2"));
    assert_eq!(answer["rank"], 27);
}

#[test]
fn mistakes_are_explained() {
    let cell = Cell::new();
    let robot = "robot.toml";
    refused(
        &cell,
        &[robot],
        &["not said what would be measured", "--kind position"],
    );
    refused(
        &cell,
        &[robot, "--kind", "positon"],
        &["no kind `positon`", "did you mean `position`?"],
    );
    refused(&cell, &[robot, "--kind", "foo"], &["same-point"]);
    for plane in ["1,2,3", "0,0,one,2", "", "1,2,3,4,5"] {
        refused(
            &cell,
            &[robot, "--plane", plane],
            &["--plane: found", "four numbers", "0,0,1,0.4"],
        );
    }
    for plane in ["0,0,0,1", "nan,0,1,1", "0,0,1,inf"] {
        refused(
            &cell,
            &[robot, "--plane", plane],
            &["normal that is not zero"],
        );
    }
    refused(
        &cell,
        &[robot, "--plane", "0,0,1,9"],
        &["robot.toml", "starting postures", "joint limits"],
    );
    refused(&cell, &[robot, "--planes", "0"], &["--planes"]);
    let position = [robot, "--kind", "position"];
    refused(
        &cell,
        &[&position[..], &["--fixed", "thta1"]].concat(),
        &["--fixed", "did you mean `theta1`?"],
    );
    refused(&cell, &["none.toml"], &["none.toml", "does not exist"]);
    refused(&cell, &["."], &["folder"]);
    refused(&cell, &["tracker.csv"], &["tracker.csv"]);
    refused(
        &cell,
        &["calibration.toml", "--kind", "pose"],
        &["--kind is for a robot file"],
    );
    cell.write("other.toml", "[package]\nname = \"x\"\n");
    refused(
        &cell,
        &["other.toml"],
        &["neither a calibration", "nor a robot"],
    );
    cell.write(
        "simulation.toml",
        "seed = 1\n[robot]\nfile = \"robot.toml\"\n",
    );
    refused(&cell, &["simulation.toml"], &["a simulation file"]);
    let run = cell.run(&["identify", robot, "--kind", "foo", "--json"]);
    assert_eq!(run.status, 2);
    assert!(
        run.json()["error"]["message"]
            .as_str()
            .unwrap()
            .contains("foo")
    );
}
