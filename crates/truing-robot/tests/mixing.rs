//! Poses, positions, touches of a known plane, touches of an unknown plane, visits of the same points and lengths
//! to an anchor can be mixed in any combination in one file: all 63 are read, run and trusted, and each
//! identifies all that any of its kinds sees.

#[path = "support/cell.rs"]
mod cell;

use cell::Cell;
use truing_robot::file::{CalibrationFile, SimulationFile};
use truing_robot::load::load;
use truing_robot::result::CalibrationResult;
use truing_robot::simulate::simulate;

const SIGMA: f64 = 5e-5;

/// The kinds, with what each cannot see of a PUMA 560 on a generic base with a generic tool, which has 30 parameters,
/// gains apart (4 for each of six joints and 6): the tool's orientation (3), two translations along and one rotation about
/// the normal of a known plane, the other three of a rigid motion, and the scale.
const KINDS: [(&str, u8); 6] = [
    ("pose", 0),
    ("position", ORIENTATION),
    ("known-plane", ORIENTATION | ALONG | SCALE),
    ("unknown-plane", ORIENTATION | ALONG | ACROSS | SCALE),
    ("same-point", ORIENTATION | ALONG | ACROSS | SCALE),
    ("ball-bar", ORIENTATION | ALONG | ACROSS),
];

const ORIENTATION: u8 = 1;
const ALONG: u8 = 2;
const ACROSS: u8 = 4;
const SCALE: u8 = 8;

/// How many parameters a subset of the kinds identifies: all but those that none of them sees.
fn identified(subset: usize) -> usize {
    let of_kind = |k: &usize| subset & (1 << k) != 0;
    let unseen = (0..KINDS.len()).filter(of_kind).map(|k| KINDS[k].1);
    let unseen = unseen.fold(u8::MAX, |all, one| all & one);
    let sizes = [(ORIENTATION, 3), (ALONG, 3), (ACROSS, 3), (SCALE, 1)];
    30 - sizes
        .iter()
        .filter(|(what, _)| unseen & what != 0)
        .map(|(_, size)| size)
        .sum::<usize>()
}

const SIMULATION: &str = r#"
seed = 7

[robot]
file = "puma560.toml"

[errors]
angle = "0.3 deg"
length = "1 mm"
gain = 0.0

[[constraint]]
kind = "pose"
data = "poses.csv"
count = 28
sigma = { position = "0.05 mm", rotation = "0.05 mrad" }

[[constraint]]
kind = "position"
data = "positions.csv"
count = 40
sigma = "0.05 mm"

[[constraint]]
kind = "known-plane"
data = "wall.csv"
count = 120
sigma = "0.05 mm"
plane = { normal = [0.05, -0.02, 1.0], distance = 0.35 }

[[constraint]]
kind = "unknown-plane"
data = "touches.csv"
count = 120
sigma = "0.05 mm"
planes = [{ normal = [0.3, 1.0, 0.1], distance = 0.3 }]

[[constraint]]
kind = "same-point"
data = "visits.csv"
count = 20
sigma = "0.05 mm"
points = [[0.55, 0.2, 0.5], [-0.1, 0.6, 0.7]]

[[constraint]]
kind = "ball-bar"
data = "lengths.csv"
count = 120
sigma = "0.05 mm"
anchors = [[0.9, 0.3, 0.2]]
"#;

/// A cell with the data of all kinds, and the pieces of its calibration file: the start, then each
/// kind. One row in five is held out.
fn measured(gains: bool) -> (Cell, Vec<String>) {
    let cell = Cell::empty();
    let robot = std::fs::read_to_string(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../examples/puma560/puma560.toml"
    ));
    cell.write("puma560.toml", robot.unwrap());
    cell.write("simulation.toml", SIMULATION);
    if gains {
        cell.edit("simulation.toml", "gain = 0.0", "gain = 0.001");
    }
    let file = SimulationFile::read(cell.path("simulation.toml")).unwrap();
    let simulated = simulate(&file, None).unwrap();
    for (k, name) in simulated.files.iter().enumerate() {
        cell.write(name, simulated.csv(k));
    }
    let text = simulated.calibration_toml(&["puma560.toml".into()]);
    let mut pieces: Vec<String> = text
        .split("[[constraint]]\n")
        .map(|piece| format!("[[constraint]]\nholdout = {{ every = 5, rows = [2] }}\n{piece}"))
        .collect();
    pieces[0] = text.split("[[constraint]]").next().unwrap().to_owned();
    if !gains {
        pieces[0] += "fixed = [\"gains\"]\n\n";
    }
    (cell, pieces)
}

/// Calibrates from the kinds whose bits are set.
fn calibrated(cell: &Cell, pieces: &[String], subset: usize) -> CalibrationResult {
    let of_kind = |k: &usize| subset & (1 << k) != 0;
    let chosen = (0..KINDS.len()).filter(of_kind);
    let text: String = chosen.map(|k| pieces[k + 1].as_str()).collect();
    cell.write("calibration.toml", pieces[0].clone() + &text);
    let file = CalibrationFile::read(cell.path("calibration.toml")).unwrap();
    load(&file).unwrap().run(&|_| {}).unwrap().result
}

/// The errors are those of the noise: used rows have at most its size (they were fitted), rows held
/// out have it and what the error of the estimate adds, at most as much again.
fn assert_fits(subset: usize, result: &CalibrationResult) {
    let kinds = subset.count_ones() as usize;
    assert_eq!(result.constraints.len(), kinds);
    assert_eq!(result.validation.len(), kinds);
    for set in result.constraints.iter().chain(&result.validation) {
        let dim = if set.rows == set.count { 1.0 } else { 3.0_f64 };
        let size = SIGMA * dim.sqrt();
        let after = set.after.as_ref().unwrap();
        for rms in [Some(after.rms), after.rotation().map(|r| r.rms)] {
            let rms = rms.unwrap_or(size) / size;
            assert!(
                (0.5..2.0).contains(&rms),
                "{subset:06b} {}: {rms}",
                set.name
            );
        }
    }
    // ± 4 deviates of √(χ²/n) with 50 degrees of freedom or more: 1 ± 4 / √100.
    let sigma0 = result.sigma0.unwrap();
    assert!((0.6..1.4).contains(&sigma0), "{subset:06b}: σ₀ = {sigma0}");
}

fn all_combinations(gains: bool) {
    let (cell, pieces) = measured(gains);
    let mut counts = [0; 64];
    for subset in 1..64 {
        let result = calibrated(&cell, &pieces, subset);
        assert!(
            result.termination.converged,
            "{subset:06b}: {}",
            result.termination.message
        );
        assert!(result.trusted, "{subset:06b}: {:?}", result.warnings);
        assert_fits(subset, &result);
        let expected = identified(subset) + if gains { 6 } else { 0 };
        assert_eq!(result.identifiable, expected, "{subset:06b}: {KINDS:?}");
        counts[subset] = result.identifiable;
    }
    for subset in 1..64 {
        for kind in 0..KINDS.len() {
            let more = subset | (1 << kind);
            assert!(counts[more] >= counts[subset], "{subset:06b} and {kind}");
        }
    }
}

#[test]
fn any_combination_of_the_six_kinds_calibrates() {
    all_combinations(false);
}

/// Each kind excites every joint: the six gains come on top, whatever the kind.
#[test]
fn any_combination_of_the_six_kinds_calibrates_with_gains() {
    all_combinations(true);
}

/// The order of the constraints in the file is no input: the result is the same but for rounding.
#[test]
fn the_order_of_the_constraints_does_not_matter() {
    let (cell, mut pieces) = measured(false);
    let forward = calibrated(&cell, &pieces, 0b111111);
    pieces[1..].reverse();
    let backward = calibrated(&cell, &pieces, 0b111111);
    for (a, b) in forward.parameters.iter().zip(&backward.parameters) {
        assert_eq!((&a.name, &a.status), (&b.name, &b.status));
        // Both stop within rounding of the same minimum, which is flat to 1e-7 of a σ.
        let sigma = a.sigma.unwrap_or(1e-9);
        assert!(
            (a.estimate - b.estimate).abs() <= 1e-6 * sigma,
            "{}",
            a.name
        );
    }
}
