//! `truing study` counts what it says it counts, the same to the last digit on any number of threads.

#[path = "support/cell.rs"]
mod cell;

use cell::Cell;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use truing_planar::Planar;
use truing_robot::Error;
use truing_robot::Registry;
use truing_robot::file::StudyFile;
use truing_robot::study::{Study, StudyResult, load_study};

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

/// A study of two kinds by two methods, with levels.
const SMALL: &str = r#"seed = 3
trials = 3
configurations = 30

[robot]
file = "puma560.toml"

[estimate]
fixed = ["gains"]

[errors]
tool_error = ["5 mm", "40 mm"]

[[case]]
name = "tracker"
[[case.constraint]]
kind = "position"
count = 30
frame = "tracker"
frame_pose = [3.0, -0.5, 0.2, 0.0, 0.0, 0.0, 1.0]

[[case]]
name = "wall"
[[case.constraint]]
kind = "known-plane"
count = 60
plane = "random"

[[method]]
name = "Gauss-Newton"
solver = "gauss-newton"
start = "nominal"

[[method]]
name = "LM"
"#;

fn load(text: &str) -> Result<Study, Error> {
    let file = StudyFile::parse(text, examples().join("puma560/study.toml"))?;
    load_study(&file, &Registry::with(&[&Planar]))
}

fn run(text: &str) -> StudyResult {
    let study = load(text).unwrap();
    study.run(Some(2), &AtomicBool::new(false), &|| ()).unwrap()
}

/// A folder with the PUMA 560 and a study of it.
fn cell(study: &str) -> Cell {
    let cell = Cell::empty();
    let robot = std::fs::read_to_string(examples().join("puma560/puma560.toml")).unwrap();
    cell.write("puma560.toml", robot);
    cell.write("study.toml", study);
    cell
}

#[test]
fn any_number_of_threads_makes_the_same_bytes() {
    let cell = cell(SMALL);
    let mut made = Vec::new();
    for threads in ["1", "2", "3"] {
        let folder = format!("out{threads}");
        let run = cell.run(&["study", "study.toml", "--threads", threads, "-o", &folder]);
        assert_eq!(run.status, 0, "{}", run.stderr);
        let files = ["study.json", "study.csv", "study.svg"];
        let files = files.map(|name| cell.read(&format!("{folder}/{name}")));
        made.push((run.stdout.replace(&folder, "out"), files));
    }
    assert!(made[0].0.contains("3 of 3"), "{}", made[0].0);
    assert_eq!(made[0], made[1]);
    assert_eq!(made[0], made[2]);
}

#[test]
fn robots_that_are_a_little_off_come_back_every_time() {
    let result = run(SMALL);
    assert!(result.complete);
    assert_eq!(result.rows.len(), 2 * 2 * 2);
    for row in &result.rows {
        assert_eq!((row.trials, row.recovered), (3, 3), "{row:?}");
        // Without noise, what is estimated is the truth: see crates/truing-robot/tests/recovery.rs for the tolerance.
        assert!(row.final_tool_error.unwrap() < 1e-9, "{row:?}");
        assert!(row.angle_error.unwrap() < 1e-9 && row.length_error.unwrap() < 1e-9);
        assert!(row.jacobian_evaluations.unwrap() > 1.0);
        assert_eq!(row.ended.values().sum::<usize>(), 3);
    }
}

#[test]
fn robots_that_are_hopelessly_off_do_not() {
    let far = SMALL.replace("\"5 mm\", \"40 mm\"", "\"1.2 m\"");
    let result = run(&far.replace("trials = 3", "trials = 6"));
    let wall = result.rows.iter().find(|row| row.case == "wall").unwrap();
    assert!(wall.recovered < wall.trials, "{wall:?}");
    assert!(wall.final_tool_error.unwrap() > 0.1, "{wall:?}");
}

/// Where the true robot touches a known plane that the nominal one cannot reach, the estimate is tried.
#[test]
fn a_plane_that_only_the_true_robot_reaches_is_no_reason_to_refuse() {
    let far = SMALL
        .replace("\"5 mm\", \"40 mm\"", "\"0.9 m\"")
        .replace("trials = 3", "trials = 24")
        .replace(
            "fixed = [\"gains\"]",
            "fixed = [\"gains\"]\nmax_iterations = 1",
        );
    for row in run(&far).rows {
        assert!(!row.ended.contains_key("refused"), "{row:?}");
    }
}

#[test]
fn errors_are_scaled_to_the_mean_tool_error_that_was_asked_for() {
    for row in run(SMALL).rows {
        let level = row.tool_error.unwrap();
        assert!(
            (row.measured_tool_error / level - 1.0).abs() < 1e-5,
            "{row:?}"
        );
    }
    let plain = SMALL.replace("tool_error = [\"5 mm\", \"40 mm\"]", "angle = '1 mrad'");
    for row in run(&plain).rows {
        assert_eq!(row.tool_error, None);
        // Twenty angles of up to 1 mrad on an arm of a metre.
        assert!((1e-4..1e-2).contains(&row.measured_tool_error), "{row:?}");
    }
}

/// The robot turned about the normal of its plane touches it as before: θ₀ is held at nominal, and
/// what comes out is the true robot, moved.
#[test]
fn a_robot_moved_rigidly_along_its_plane_is_recovered() {
    let turned = SMALL
        .replace(
            "plane = \"random\"",
            "plane = { normal = [0, 0, 1], distance = 0.35 }",
        )
        .replace(
            "tool_error",
            "parameters = ['identifiable', 'theta0']\ntool_error",
        );
    let result = run(&turned);
    for row in result.rows.iter().filter(|row| row.case == "wall") {
        assert_eq!(row.recovered, 3, "{row:?}");
        assert_eq!(
            row.angle_error, None,
            "its parameters cannot be compared one by one"
        );
    }
}

/// Touches of an unknown plane do not see how large a robot is. (r₃ is left alone: it is told from r₂
/// as soon as the axes are not parallel.)
#[test]
fn a_robot_of_another_size_is_recovered_where_nothing_measures_lengths() {
    let errors = "parameters = 'all'\nfixed = ['gains', 'r3']\ntool_error";
    let larger = SMALL
        .replace("tool_error", errors)
        .replace("kind = \"known-plane\"", "kind = \"unknown-plane\"")
        .replace("plane = \"random\"", "planes = 2");
    for row in run(&larger).rows.iter().filter(|row| row.case == "wall") {
        assert_eq!(row.recovered, 3, "{row:?}");
    }
}

/// Twice the noise on the touches is about twice the error of the robot, and still the same robot.
#[test]
fn noise_shows_in_the_errors_and_not_in_the_count() {
    let noisy =
        |sigma: &str| run(&SMALL.replace("count = ", &format!("sigma = '{sigma}'\ncount = ")));
    let (little, more) = (noisy("0.05 mm"), noisy("0.1 mm"));
    for (a, b) in little.rows.iter().zip(&more.rows) {
        assert_eq!((a.recovered, b.recovered), (3, 3), "{b:?}");
        let ratio = b.final_tool_error.unwrap() / a.final_tool_error.unwrap();
        assert!((1.8..2.2).contains(&ratio), "{}: {ratio}", a.case);
    }
}

#[test]
fn cases_share_their_robots_and_other_seeds_draw_others() {
    let result = run(SMALL);
    let another = run(&SMALL.replace("seed = 3", "seed = 4"));
    assert_ne!(result.rows, another.rows);
    let more = SMALL.replace(
        "[[method]]\nname = \"LM\"",
        "[[method]]\nname = \"more\"\n[[method]]\nname = \"LM\"",
    );
    let of = |result: &StudyResult, name: &str| -> Vec<_> {
        let rows = result.rows.iter().filter(|row| row.method == name);
        rows.cloned().collect()
    };
    // Another method changes nothing of the others.
    assert_eq!(of(&result, "LM"), of(&run(&more), "LM"));
}

#[test]
fn an_interrupt_ends_it_after_the_trials_under_way() {
    let study = load(SMALL).unwrap();
    assert_eq!(study.trials(), 2 * 2 * 3);
    let (flag, done) = (AtomicBool::new(false), AtomicUsize::new(0));
    let tick = || {
        if done.fetch_add(1, Ordering::SeqCst) + 1 == 2 {
            flag.store(true, Ordering::SeqCst);
        }
    };
    let result = study.run(Some(2), &flag, &tick).unwrap();
    assert!(!result.complete);
    let finished: usize = result.rows.iter().map(|row| row.trials).sum();
    assert_eq!(
        finished,
        2 * done.load(Ordering::SeqCst),
        "two methods a trial"
    );
    assert!(done.load(Ordering::SeqCst) < study.trials());
    // Interrupted from the beginning: a table without numbers.
    let nothing = study.run(Some(1), &flag, &|| ()).unwrap();
    assert!(
        nothing
            .rows
            .iter()
            .all(|row| row.trials == 0 && row.share.is_none())
    );
}

#[cfg(unix)]
#[test]
fn ctrl_c_reports_what_is_finished_and_writes_nothing() {
    let cell = cell(&SMALL.replace("trials = 3", "trials = 2000"));
    let mut command = cell.command(&["study", "study.toml", "--json", "--output", "out"]);
    let piped = std::process::Stdio::piped;
    let child = command.stdout(piped()).stderr(piped()).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_secs(3));
    let process = child.id().to_string();
    let kill = std::process::Command::new("kill")
        .args(["-INT", &process])
        .status();
    assert!(kill.unwrap().success());
    let run = cell::Run::of(child.wait_with_output().unwrap());
    assert_eq!(run.status, 1, "{}", run.stderr);
    assert_eq!(run.json()["complete"], false);
    assert!(run.stderr.contains("stopped"), "{}", run.stderr);
    assert!(
        run.stderr.contains("nothing written to out"),
        "{}",
        run.stderr
    );
    assert!(!cell.path("out").exists());
}

#[test]
fn what_is_written_is_complete_and_nothing_is_overwritten() {
    let cell = cell(&SMALL.replace("trials = 3", "trials = 1"));
    let arguments = ["study", "study.toml", "--json", "--output", "out"];
    let first = cell.run(&arguments);
    assert_eq!(first.status, 0, "{}", first.stderr);
    assert_eq!(first.stdout, cell.read("out/study.json"));
    let json = first.json();
    assert_eq!(
        (&json["seed"], &json["trials"], &json["complete"]),
        (&3.into(), &1.into(), &true.into())
    );
    let rows = json["rows"].as_array().unwrap();
    let mut keys: Vec<&str> = rows[0]
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect();
    keys.sort_unstable();
    assert_eq!(
        keys.join(" "),
        "angle_error case ended final_residual final_tool_error iterations jacobian_evaluations length_error \
         measured_tool_error method out_of_reach recovered redrawn residual_evaluations share tolerance tool_error \
         trials"
    );
    assert_eq!(rows[0]["iterations"].as_object().unwrap().len(), 3);
    let csv = cell.read("out/study.csv");
    assert_eq!(csv.lines().count(), 1 + rows.len());
    let columns = |line: &str| line.split(',').count();
    assert!(
        csv.lines()
            .all(|line| columns(line) == columns(csv.lines().next().unwrap()))
    );
    let svg = cell.read("out/study.svg");
    for text in [
        "tracker",
        "wall",
        "Gauss-Newton",
        "LM",
        "recovered [%]",
        "mean initial tool error [m]",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    assert!(svg.trim_end().ends_with("</svg>"));

    let before = cell.files();
    let second = cell.run(&arguments);
    assert_eq!(second.status, 2);
    assert!(
        second.stderr.contains("not overwritten"),
        "{}",
        second.stderr
    );
    assert_eq!(cell.files(), before);
    let other = cell.run(&[&arguments[..], &["--force", "--seed", "9", "--trials", "2"]].concat());
    assert_eq!(other.status, 0, "{}", other.stderr);
    assert_eq!(
        (&other.json()["seed"], &other.json()["trials"]),
        (&9.into(), &2.into())
    );
    assert_eq!(other.stdout, cell.read("out/study.json"));
}

/// What is wrong, where, and what to do.
#[test]
fn mistakes_are_shown_where_they_are() {
    let mut wrong = Vec::new();
    for (from, to, line, words) in [
        ("trials = 3", "trials = 0", 2, "found 0"),
        ("trials = 3", "trails = 3", 2, "unknown key `trails`"),
        ("configurations = 30", "tolerance = 0", 3, "more than 0"),
        ("puma560.toml", "puma.toml", 6, "does not exist"),
        ("\"40 mm\"", "\"-40 mm\"", 12, "found -0.04"),
        ("\"40 mm\"", "\"40 deg\"", 12, "found an angle"),
        ("[\"5 mm\", \"40 mm\"]", "[]", 12, "at least one"),
        (
            "tool_error",
            "angle = 0\ntool_error",
            13,
            "sizes of errors are zero",
        ),
        ("tool_error", "parameters = ['K9']\ntool_error", 12, "`K9`"),
        (
            "tool_error",
            "given = { r2 = 1 }\ntool_error",
            12,
            "unknown key `given`",
        ),
        ("kind = \"position\"", "kind = \"positon\"", 17, "positon"),
        (
            "count = 30\n",
            "count = 30\ndata = 'x.csv'\n",
            19,
            "unknown key `data`",
        ),
        ("name = \"wall\"", "name = \"tracker\"", 22, "second case"),
        ("plane = \"random\"", "plane = \"any\"", 27, "plane"),
        (
            "plane = \"random\"",
            "plane = { normal = [0, 0, 1], distance = 9 }",
            22,
            "cannot make",
        ),
        ("count = 60", "count = 2", 22, "found 2 measured values"),
        (
            "name = \"LM\"",
            "name = \"Gauss-Newton\"",
            34,
            "second method",
        ),
        (
            "name = \"LM\"",
            "name = \"LM\"\nmethod = \"papr\"",
            36,
            "no method `papr`",
        ),
        (
            "name = \"LM\"",
            "name = \"LM\"\nmethod = \"vector-products\"",
            36,
            "none of the cases",
        ),
        (
            "name = \"LM\"",
            "name = \"LM\"\nsolver = \"newton\"",
            36,
            "newton",
        ),
        (
            "name = \"LM\"",
            "name = \"LM\"\nstart = \"here\"",
            36,
            "here",
        ),
        (
            "name = \"LM\"",
            "name = \"LM\"\nsolvr = \"x\"",
            36,
            "unknown key `solvr`",
        ),
        ("fixed = [\"gains\"]", "fixed = [\"gain\"]", 9, "gain"),
        ("[errors]", "[eror]", 0, "no [errors]"),
    ] {
        assert!(SMALL.contains(from), "{from}");
        let text = SMALL.replacen(from, to, 1);
        match load(&text).err() {
            Some(Error::Input(error))
                if error.to_string().contains(words)
                    && error.line.unwrap_or(0) == line
                    && error.help.is_some() => {}
            other => wrong.push(format!("{to}: {other:?}")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let end = SMALL.find("[[method]]").unwrap();
    let error = load(&SMALL[..end]).err().unwrap();
    assert!(
        error.to_string().contains("there is no [[method]]"),
        "{error}"
    );
    let angles = SMALL.replace(
        "tool_error = [\"5 mm\"",
        "angle = 1\ntool_error = [\"5000 m\"",
    );
    let study = load(&angles).unwrap();
    let error = study
        .run(None, &AtomicBool::new(false), &|| ())
        .unwrap_err();
    assert!(
        error.to_string().contains(":13: no size of the errors"),
        "{error}"
    );
}

#[test]
fn the_program_shows_a_mistake_with_its_line() {
    let cell = cell(&SMALL.replace("trials = 3", "trials = 0"));
    let before = cell.files();
    let run = cell.run(&["study", "study.toml", "--json", "--output", "out"]);
    assert_eq!(run.status, 2);
    let error: Value = run.json();
    assert_eq!(error["error"]["line"], 2);
    assert_eq!(error["error"]["file"], "study.toml");
    assert_eq!(cell.files(), before);
    let run = cell.run(&["study", "study.toml", "--threads", "0"]);
    assert_eq!(run.status, 2);
}

#[test]
fn the_studies_of_the_examples_load_and_the_small_one_runs() {
    for entry in std::fs::read_dir(examples().join("studies")).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            continue;
        }
        let file = StudyFile::read(&path).unwrap();
        let study = load_study(&file, &Registry::with(&[&Planar])).unwrap();
        if path.ends_with("tracker.toml") {
            let result = study.run(None, &AtomicBool::new(false), &|| ()).unwrap();
            let count = |row: &truing_robot::study::StudyRow| row.recovered == row.trials;
            assert!(result.rows.iter().all(count), "{result:?}");
        }
    }
}

/// A row of a committed table: case, method, tool error, recovered of 100.
fn published(name: &str) -> Vec<(String, String, String, usize)> {
    let path = examples().join("studies/results").join(name);
    let text = std::fs::read_to_string(&path).unwrap();
    let mut case = String::new();
    let mut rows = Vec::new();
    for line in text.lines() {
        if let Some((name, _)) = line.split_once(": recovered to ") {
            case = name.to_owned();
        } else if let Some((before, _)) = line.split_once(" of 100 ") {
            let words: Vec<&str> = before.split_whitespace().collect();
            let (error, rest) = words.split_first().unwrap();
            let (count, method) = rest.split_last().unwrap();
            rows.push((
                case.clone(),
                method.join(" "),
                (*error).to_owned(),
                count.parse().unwrap(),
            ));
        }
    }
    assert!(rows.len() >= 54, "{} rows in {name}", rows.len());
    rows
}

/// The tables that the book shows: every robot up to 0.55 m, at least 95 of 100 at 0.9 m, wherever the
/// plane is; the paper's method falls short where its authors' claim does.
#[test]
fn the_published_tables_say_what_the_book_says() {
    for (case, method, error, recovered) in published("planar.txt") {
        let far = error == "0.9000";
        match method.as_str() {
            "Truing" => assert!(
                recovered >= if far { 95 } else { 100 },
                "{case}, {error}: {recovered}"
            ),
            "the paper's" if far => assert!(recovered <= 5, "{case}: {recovered}"),
            "the paper's" if case.contains("2 cm") => {
                assert!(recovered <= 30, "{case}: {recovered}")
            }
            _ => {}
        }
    }
    // With noise the data are the limit: nothing is lost that a start at the truth would have found.
    let noisy = published("planar-noise.txt");
    for (case, method, error, recovered) in &noisy {
        if method == "Truing" {
            let same = |row: &&(String, String, String, usize)| {
                (&row.0, &row.2) == (case, error) && row.1 == "from the truth"
            };
            let best = noisy.iter().find(same).unwrap().3;
            assert!(
                recovered + 2 >= best,
                "{case}, {error}: {recovered} of {best}"
            );
        }
    }
}

/// The tables come out again: exactly on the same processor, to two robots on another.
#[test]
#[ignore = "minutes: cargo test --release -p truing-cli --test study -- --ignored"]
fn the_published_tables_come_out_again() {
    for name in ["planar", "planar-noise"] {
        let path = examples().join("studies").join(format!("{name}.toml"));
        let study =
            load_study(&StudyFile::read(path).unwrap(), &Registry::with(&[&Planar])).unwrap();
        let result = study.run(None, &AtomicBool::new(false), &|| ()).unwrap();
        let expected = published(&format!("{name}.txt"));
        assert_eq!(result.rows.len(), expected.len());
        for (row, (case, method, error, recovered)) in result.rows.iter().zip(expected) {
            assert_eq!((&row.case, &row.method), (&case, &method));
            assert!(
                row.recovered.abs_diff(recovered) <= 2,
                "{case}, {method}, {error}: {}",
                row.recovered
            );
        }
    }
}
