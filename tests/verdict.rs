//! What is trusted is better than the nominal robot: simulated flaws, by a forward model of its own.

#![allow(dead_code, reason = "the simulator has more than each test uses")]

#[path = "support/cell.rs"]
mod cell;
#[path = "support/flaws.rs"]
mod flaws;
#[path = "support/forward.rs"]
mod forward;

use cell::Cell;
use flaws::{Data, Fault, Flaw, Size, case, flaws as all_flaws, robots};
use truing_robot::Outcome;
use truing_robot::doubt::{Doubt, Suspect};

/// The outcome of a flaw on the PUMA, and how far the tool is off on fresh postures, nominal and calibrated.
fn outcome(flaw: &Flaw, seed: u64) -> (Outcome, f64, f64) {
    let mut case = case(&robots()[0], flaw, seed).unwrap();
    let outcome = case.calibration.calibrate().unwrap();
    let truth = case.truth(&outcome);
    (outcome, truth.nominal, truth.calibrated)
}

#[test]
fn a_robot_that_is_off_and_measured_well_is_trusted_and_better() {
    for (data, count) in [
        (Data::Positions, 20),
        (Data::Tracker, 40),
        (Data::Poses, 30),
        (Data::Plane, 60),
    ] {
        for seed in 0..3 {
            let (outcome, nominal, calibrated) = outcome(&Flaw::plain(data, count), seed);
            assert!(
                outcome.result.trusted,
                "{data:?} {seed}: {:?}",
                outcome.result.warnings
            );
            assert!(
                calibrated < 0.3 * nominal,
                "{data:?} {seed}: {calibrated} of {nominal}"
            );
        }
    }
}

#[test]
fn a_robot_as_good_as_its_drawing_is_not_made_worse() {
    for (data, count) in [
        (Data::Positions, 20),
        (Data::Tracker, 40),
        (Data::Plane, 60),
        (Data::Points, 60),
    ] {
        for seed in 0..3 {
            let flaw = Flaw {
                size: Size::None,
                noise: 3e-4,
                ..Flaw::plain(data, count)
            };
            let (outcome, nominal, calibrated) = outcome(&flaw, seed);
            assert!(
                !outcome.result.trusted || calibrated < 1.1 * nominal,
                "{data:?} {seed}"
            );
        }
    }
}

#[test]
fn wrong_inputs_are_refused_and_named() {
    for flaw in all_flaws()
        .iter()
        .filter(|f| f.fault.is_of_the_file() && f.data == Data::Tracker)
    {
        let (outcome, ..) = outcome(flaw, 3);
        assert!(!outcome.result.trusted, "{}", flaw.name());
        let named = outcome.result.doubts.iter().find_map(|doubt| match doubt {
            Doubt::Input { suspect, .. } => Some(suspect),
            _ => None,
        });
        let right = match (&flaw.fault, named) {
            (Fault::Offset(1, by), Some(Suspect::ZeroOffset { joint, offset })) => {
                joint == "q2" && (offset - by).abs() < 1e-9
            }
            (Fault::Flipped(2), Some(Suspect::Direction { joint })) => joint == "q3",
            (Fault::Swapped(1, 3), Some(Suspect::Swapped { joint, other })) => {
                joint == "q2" && other == "q4"
            }
            (Fault::Shifted, Some(Suspect::Shifted { rows, .. })) => rows.abs() == 1,
            (Fault::Mirrored, Some(Suspect::Mirrored { .. })) => true,
            _ => false,
        };
        assert!(right, "{}: {:?}", flaw.name(), outcome.result.warnings);
    }
}

/// The unit of lengths in the files, of the robot and of the readings, makes no difference.
#[test]
fn the_unit_of_lengths_makes_no_difference() {
    let cell = Cell::new();
    let in_metres = cell.calibrate();
    let readings = cell.readings(40);
    let mut text = format!("{},x [mm],y [mm],z [mm]\n", cell::JOINTS);
    for reading in readings {
        let [x, y, z] = reading.position.map(|x| x * 1e3);
        text += &format!("{},{x:?},{y:?},{z:?}\n", cell::cells(&reading.q));
    }
    cell.write("tracker.csv", text);
    let in_millimetres = cell.calibrate();
    let kinds = |result: &serde_json::Value| -> Vec<String> {
        let doubts = result["doubts"].as_array().unwrap();
        doubts
            .iter()
            .map(|doubt| doubt["kind"].to_string())
            .collect()
    };
    assert_eq!(kinds(&in_metres), kinds(&in_millimetres));
    let bound = |result: &serde_json::Value| result["everywhere"][0]["bound"].as_f64().unwrap();
    assert!((bound(&in_metres) / bound(&in_millimetres) - 1.0).abs() < 1e-6);
}

/// Rows of the book's table are what the simulator gives: trusted, better and worse, refused, better and worse.
#[test]
fn the_table_of_the_book_is_that_of_the_simulator() {
    const TABLE: &str = include_str!("../examples/confusion.md");
    let flaws = all_flaws();
    for (k, flaw) in flaws
        .iter()
        .enumerate()
        .filter(|(_, flaw)| flaw.count == 14)
    {
        let name = flaw.name();
        let cells: Vec<&str> = (TABLE.lines())
            .map(|line| line.split('|').map(str::trim).collect::<Vec<_>>())
            .find(|cells| cells.get(1) == Some(&name.as_str()))
            .unwrap();
        let shown: Vec<usize> = [2, 3, 4, 6, 7, 8]
            .map(|cell| cells[cell].parse().unwrap())
            .into();
        let mut found = vec![0; 6];
        for robot in &robots() {
            for seed in 0..20 {
                let mut case = case(robot, flaw, 1000 * k as u64 + seed).unwrap();
                let outcome = case.calibration.calibrate().unwrap();
                let truth = case.truth(&outcome);
                let first = if outcome.result.trusted { 0 } else { 3 };
                let ratio = truth.calibrated / truth.nominal;
                found[first] += 1;
                found[first + 1] += usize::from(ratio < 0.9);
                found[first + 2] += usize::from(ratio > 1.1);
            }
        }
        assert_eq!(found, shown, "{name}");
    }
}
