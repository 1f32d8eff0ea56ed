//! `truing simulate` makes data that are what they say: reproducible, within the joint limits, exact
//! but for the noise that was asked for, and ready to be calibrated from.

#[path = "support/cell.rs"]
mod cell;

use cell::Cell;
use std::path::Path;
use truing::manifold::{Plane3, Point3, Pose3};
use truing::nalgebra::Vector3;

use truing_robot::file::SimulationFile;
use truing_robot::kinds::{Distances, KnownPlaneTouches, pose_of};
use truing_robot::measurement::At;
use truing_robot::simulate::{Simulated, simulate};

fn example() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/puma560")
}

/// Every kind on one robot; what follows `sigma` in a constraint is its noise.
const EVERYTHING: &str = r#"seed = 11

[robot]
file = "puma560.toml"

[errors]
angle = "0.3 deg"
length = "1 mm"
gain = 0.001

[[constraint]]
kind = "pose"
data = "poses.csv"
count = 20

[[constraint]]
kind = "position"
data = "tracker.csv"
count = 30
frame = "tracker"
frame_pose = [3.0, -0.5, 0.2, 0.0, 0.0, 0.0, 1.0]
target = "reflector"
target_position = [0.02, 0.0, 0.1]

[[constraint]]
kind = "known-plane"
data = "wall.csv"
count = 200
plane = { normal = [0.3, 1.0, 0.1], distance = 0.3 }

[[constraint]]
kind = "unknown-plane"
data = "touches.csv"
count = 100
planes = 2

[[constraint]]
kind = "same-point"
data = "visits.csv"
count = 50
points = 2

[[constraint]]
kind = "distance"
data = "bar.csv"
count = 100
distance = 0.5

[[constraint]]
kind = "same-location"
data = "docks.csv"
count = 8
locations = 12
"#;

/// A folder with the PUMA 560 and a simulation of it.
fn cell(simulation: &str) -> Cell {
    let cell = Cell::empty();
    let robot = std::fs::read_to_string(example().join("puma560.toml")).unwrap();
    cell.write("puma560.toml", robot);
    cell.write("simulation.toml", simulation);
    cell
}

/// The simulation with noise of 0.1 mm (and 0.1 mrad) on everything.
fn noisy(simulation: &str) -> String {
    let kinds = simulation.replace("\ncount = ", "\nsigma = \"0.1 mm\"\ncount = ");
    kinds.replacen(
        "sigma = \"0.1 mm\"",
        "sigma = { position = \"0.1 mm\", rotation = \"0.1 mrad\" }",
        1,
    )
}

fn simulated(text: &str, seed: Option<u64>) -> Simulated {
    let file = SimulationFile::parse(text, example().join("simulation.toml")).unwrap();
    simulate(&file, seed).unwrap()
}

fn tables(simulated: &Simulated) -> Vec<String> {
    (0..simulated.sets.len())
        .map(|k| simulated.csv(k))
        .collect()
}

/// Runs `truing simulate simulation.toml --output` and wants it to go well.
#[track_caller]
fn run(cell: &Cell, folder: &str, more: &[&str]) {
    let arguments = [&["simulate", "simulation.toml", "--output", folder], more].concat();
    let run = cell.run(&arguments);
    assert_eq!(run.status, 0, "{}", run.stderr);
}

/// The files of a folder, by name.
fn contents(folder: &Path) -> Vec<(String, String)> {
    let mut files: Vec<(String, String)> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            (name, std::fs::read_to_string(path).unwrap())
        })
        .collect();
    files.sort();
    files
}

#[test]
fn the_same_file_and_seed_make_the_same_bytes() {
    let cell = cell(&noisy(EVERYTHING));
    run(&cell, "a", &[]);
    run(&cell, "b", &[]);
    run(&cell, "c", &["--seed", "11"]);
    let files = contents(&cell.path("a"));
    assert_eq!(
        files.len(),
        7 + 4,
        "the data, two robots, calibration and truth"
    );
    assert_eq!(files, contents(&cell.path("b")));
    assert_eq!(files, contents(&cell.path("c")));
}

#[test]
fn another_seed_makes_other_data() {
    let cell = cell(&noisy(EVERYTHING));
    run(&cell, "a", &[]);
    run(&cell, "b", &["--seed", "12"]);
    for ((name, a), (_, b)) in contents(&cell.path("a"))
        .iter()
        .zip(contents(&cell.path("b")))
    {
        // What is known beforehand is the same: only the seed in the robot's first line differs.
        let same = name == "calibration.toml";
        assert_eq!(*a == b, same, "{name}");
    }
}

#[test]
fn the_example_data_are_what_the_program_makes_of_the_example_file() {
    let cell = Cell::empty();
    let file = example().join("simulation.toml");
    let run = cell.run(&["simulate", file.to_str().unwrap(), "--output", "data"]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    assert_eq!(
        contents(&cell.path("data")),
        contents(&example().join("data"))
    );
}

#[test]
fn joints_stay_within_their_limits() {
    for text in [EVERYTHING.to_owned(), noisy(EVERYTHING)] {
        let simulated = simulated(&text, None);
        let limits: Vec<[f64; 2]> = simulated.arms[0]
            .robot
            .joints()
            .iter()
            .map(|joint| joint.limits.unwrap())
            .collect();
        for set in &simulated.sets {
            for q in set.tools.iter().flat_map(|tool| &tool.q) {
                for (q, [lower, upper]) in q.iter().zip(&limits) {
                    assert!((*lower..=*upper).contains(q), "`{}`: {q}", set.name);
                }
            }
        }
    }
}

/// What the true robot is off, in lengths \[m\] of one or three components a measurement.
fn off(simulated: &Simulated, k: usize) -> Vec<f64> {
    let (set, truth) = (&simulated.sets[k], &simulated.truth);
    let at = At {
        arms: &simulated.arms,
        readings: &set.readings,
        state: truth,
    };
    let mut errors = Vec::new();
    for row in 0..set.len() {
        let p = at.tip(0, row);
        let group = set.groups.of_row[row];
        let seen = || Vector3::from_column_slice(&set.values.row(row)[..3]);
        match set.kind.name() {
            "pose" => errors.extend((seen() - p).iter()),
            "position" => errors.extend((at.sensor().apply(&seen()) - p).iter()),
            "known-plane" => {
                let touches = set.kind.downcast::<KnownPlaneTouches>().unwrap();
                errors.push(touches.plane.signed_distance(&p));
            }
            "unknown-plane" => {
                let plane = at.own_as::<Plane3>(group, "plane").unwrap();
                errors.push(plane.signed_distance(&p));
            }
            "same-point" => {
                errors.extend((at.own_as::<Point3>(group, "point").unwrap() - p).iter());
            }
            "same-location" => {
                let location = at.own_as::<Pose3>(group, "location").unwrap();
                errors.extend((location.translation - p).iter());
            }
            "distance" => {
                let distances = set.kind.downcast::<Distances>().unwrap();
                errors.push((p - at.tip(1, row)).norm() - distances.distance.unwrap());
            }
            other => panic!("{other}"),
        }
    }
    errors
}

#[test]
fn without_noise_every_measurement_is_exact() {
    let simulated = simulated(EVERYTHING, None);
    for (k, set) in simulated.sets.iter().enumerate() {
        // Touches and visits are solved for to 1e-12 m; a tracker at 3 m rounds to 1e-15 m.
        let worst = off(&simulated, k)
            .iter()
            .fold(0.0_f64, |m, e| m.max(e.abs()));
        println!("{}: {worst:.1e}", set.name);
        assert!(worst < 1e-11, "`{}`: {worst:e} m", set.name);
    }
}

/// The sum of n squared errors over σ² is χ²(n); between the quantiles of a normal deviate of ∓4
/// (Wilson & Hilferty 1931) all but one in 16,000 lie. The seed is fixed.
#[test]
fn with_noise_measurements_scatter_as_was_asked_for() {
    let simulated = simulated(&noisy(EVERYTHING), None);
    for (k, set) in simulated.sets.iter().enumerate() {
        let errors = off(&simulated, k);
        let n = errors.len() as f64;
        let sum: f64 = errors.iter().map(|e| (e / 1e-4).powi(2)).sum();
        let quantile = |z: f64| n * (1.0 - 2.0 / (9.0 * n) + z * (2.0 / (9.0 * n)).sqrt()).powi(3);
        println!("{}: {sum:.0} of {n}", set.name);
        assert!(
            (quantile(-4.0)..quantile(4.0)).contains(&sum),
            "`{}`: {sum}",
            set.name
        );
    }
    let poses = &simulated.sets[0];
    let robot = &simulated.arms[0].robot;
    let angles = poses.q().iter().enumerate().map(|(row, q)| {
        let seen = pose_of(poses.values.row(row));
        let tool = robot.forward(&simulated.truth.robots[0], q);
        let turn = tool.rotation.transpose() * seen.rotation;
        Vector3::new(turn[(2, 1)], turn[(0, 2)], turn[(1, 0)]).norm_squared() / 1e-8
    });
    // χ²(60): 60 ± 4 √120, skewed.
    let sum: f64 = angles.sum();
    assert!((26.0..115.0).contains(&sum), "rotations: {sum}");
}

#[test]
fn planes_can_be_drawn_at_a_distance_from_the_origin() {
    let text = EVERYTHING
        .replace(
            "plane = { normal = [0.3, 1.0, 0.1], distance = 0.3 }",
            "plane = \"random\"",
        )
        .replace("planes = 2", "planes = 2\nplane_distance = \"2 cm\"");
    let (one, other) = (simulated(&text, None), simulated(&text, Some(12)));
    let planes = one.truth.iter();
    let planes = planes.filter_map(|(_, value)| value.get::<Plane3>());
    assert_eq!(
        planes
            .map(|plane| assert!((plane.distance.abs() - 0.02).abs() < 1e-15))
            .count(),
        2
    );
    let known = |simulated: &Simulated| {
        let kind = &simulated.sets[2].kind;
        kind.downcast::<KnownPlaneTouches>().unwrap().plane
    };
    assert_ne!(known(&one), known(&other));
    assert!(off(&one, 2).iter().all(|e| e.abs() < 1e-11));
    // What is written says where it is.
    let shown = format!("distance = {:?}", known(&one).distance);
    assert!(one.calibration_toml(&["r.toml".into()]).contains(&shown));
    let given = EVERYTHING.replace("distance = 0.3 }", "distance = 0.3 }\nplane_distance = 0.1");
    let error = SimulationFile::parse(&given, "s.toml").unwrap_err();
    assert!(
        error.to_string().contains("the planes are given"),
        "{error}"
    );
}

#[test]
fn a_plane_out_of_reach_is_refused_and_nothing_is_written() {
    let cell = cell(&EVERYTHING.replace("distance = 0.3 }", "distance = 4.5 }"));
    let before = cell.files();
    let run = cell.run(&["simulate", "simulation.toml", "--output", "out"]);
    assert_eq!(run.status, 2, "{}", run.stderr);
    assert!(run.stderr.contains("`wall`"), "{}", run.stderr);
    assert!(run.stderr.contains("plane"), "{}", run.stderr);
    assert!(run.stderr.contains("joint limits"), "{}", run.stderr);
    assert_eq!(cell.files(), before);
}

/// Errors in all that poses identify (r₃ is not told from r₂): what is written is calibrated as it
/// is, without a line changed, and finds them.
#[test]
fn what_is_written_calibrates_and_finds_the_truth() {
    let text = EVERYTHING.replace("gain = 0.001", "gain = 0.001\nfixed = [\"r3\"]");
    let cell = cell(&text);
    run(&cell, "data", &[]);
    let run = cell.run(&["calibrate", "data/calibration.toml", "--json"]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let truth: serde_json::Value = serde_json::from_str(&cell.read("data/truth.json")).unwrap();
    let result = run.json();
    // Six of the tracker's frame, three of the reflector, 36 of the robot.
    assert_eq!(result["identifiable"], 45);
    let close = |what: &str, a: &serde_json::Value, b: &serde_json::Value| {
        let off = (a.as_f64().unwrap() - b.as_f64().unwrap()).abs();
        // Written data have all their digits; see crates/truing-robot/tests/recovery.rs for the tolerance.
        assert!(off < 1e-9, "{what}: {a} and truly {b}");
    };
    for parameter in result["parameters"].as_array().unwrap() {
        let name = parameter["name"].as_str().unwrap();
        close(name, &parameter["estimate"], &truth["parameters"][name]);
    }
    for (kind, key, of) in [
        ("frames", "position", 3),
        ("targets", "position", 3),
        ("points", "position", 3),
        ("planes", "normal", 3),
    ] {
        let (found, true_ones) = (result[kind].as_array().unwrap(), &truth[kind]);
        assert_eq!(found.len(), true_ones.as_array().unwrap().len(), "{kind}");
        for (k, found) in found.iter().enumerate() {
            // A plane's normal may point either way.
            let sign = if kind == "planes" {
                (found["distance"].as_f64().unwrap() * true_ones[k]["distance"].as_f64().unwrap())
                    .signum()
            } else {
                1.0
            };
            for i in 0..of {
                let found = serde_json::json!(sign * found[key][i].as_f64().unwrap());
                close(kind, &found, &true_ones[k][key][i]);
            }
        }
    }
}

/// Two arms that touch: the calibration that is written reads both robots and the joint columns of
/// both, and identifies 2 × 27 less the six motions of both together, and twelve gains.
#[test]
fn two_robots_that_touch_calibrate_too() {
    let cell = cell(
        r#"seed = 5

[robots.left]
file = "puma560.toml"

[robots.right]
file = "right.toml"

[errors]
angle = "0.2 deg"
length = "0.5 mm"

[[constraint]]
kind = "distance"
robots = ["left", "right"]
data = "spheres.csv"
count = 300
distance = "60 mm"
sigma = "0.02 mm"
"#,
    );
    cell.write("right.toml", cell.read("puma560.toml"));
    cell.edit("right.toml", "d = 0.15", "d = 0.9");
    cell.edit("right.toml", "theta = 17.0", "theta = 40.0");
    run(&cell, "data", &[]);
    let names = contents(&cell.path("data"));
    for name in [
        "robot-left.toml",
        "robot-right.toml",
        "true-robot-left.toml",
        "spheres.csv",
    ] {
        assert!(names.iter().any(|(n, _)| n == name), "{name}");
    }
    let run = cell.run(&["calibrate", "data/calibration.toml", "--json"]);
    assert_eq!(run.status, 0, "{}", run.stderr);
    let result = run.json();
    assert_eq!(result["identifiable"], 2 * 27 - 6 + 12);
    let rms = result["constraints"][0]["after"]["rms"].as_f64().unwrap();
    assert!(rms < 2e-5, "{rms}: fitted, so below the noise");
    let before = result["constraints"][0]["before"]["rms"].as_f64().unwrap();
    assert!(before > 1e-3, "{before}: the errors were there");
}

#[test]
fn errors_that_are_given_replace_the_random_ones() {
    let given = "gain = 0.001\ngiven = { theta2 = '0.1 deg', r6 = '-0.5 mm', 'K*' = 0.002 }";
    let plain = simulated(EVERYTHING, None);
    let with = simulated(&EVERYTHING.replace("gain = 0.001", given), None);
    let robot = &with.arms[0].robot;
    for (k, parameter) in robot.parameters().iter().enumerate() {
        let error = with.truth.robots[0][k] - parameter.nominal;
        let expected = match parameter.name.as_str() {
            "theta2" => 0.1_f64.to_radians(),
            "r6" => -5e-4,
            name if name.starts_with('K') => 0.002,
            _ => plain.truth.robots[0][k] - parameter.nominal,
        };
        assert!((error - expected).abs() < 1e-15, "{}", parameter.name);
    }
}

#[test]
fn errors_stay_within_their_sizes_and_where_they_are_asked_for() {
    let text = EVERYTHING.replace(
        "gain = 0.001",
        "gain = 0.001\nparameters = ['theta*', 'K2']",
    );
    for seed in 0..20 {
        let simulated = simulated(&text, Some(seed));
        for (p, value) in simulated.arms[0]
            .robot
            .parameters()
            .iter()
            .zip(&simulated.truth.robots[0])
        {
            let error = (value - p.nominal).abs();
            let size = match p.name.as_str() {
                name if name.starts_with("theta") => 0.3_f64.to_radians(),
                "K2" => 1e-3,
                _ => 0.0,
            };
            assert!(error <= size * (1.0 + 1e-9), "{}: {error}", p.name);
            assert_eq!(error > 0.0, size > 0.0, "{}", p.name);
        }
    }
}

#[test]
fn another_constraint_leaves_the_data_of_the_others_as_they_were() {
    let before = tables(&simulated(&noisy(EVERYTHING), None));
    let more = noisy(EVERYTHING)
        + "\n[[constraint]]\nkind = 'position'\ndata = 'more.csv'\ncount = 5\nsigma = '1 mm'\n";
    let after = tables(&simulated(&more, None));
    assert_eq!(after.len(), before.len() + 1);
    assert_eq!(after[..before.len()], before);
}
