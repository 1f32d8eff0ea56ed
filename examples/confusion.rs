//! How often a result is trusted that is worse than the nominal robot, and refused that is better.
//!
//! Simulated robots with every kind of flaw are calibrated, and their tools compared with the truth on fresh postures:
//! `cargo run --release --example confusion -- [SEEDS] [PART OF A NAME]`; the book shows what 20 seeds print, confusion.md.

#[path = "../tests/support/flaws.rs"]
mod flaws;
#[path = "../tests/support/forward.rs"]
mod forward;

use flaws::{Truth, case, flaws, robots};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// What became of one case.
struct Judged {
    flaw: String,
    robot: String,
    of_the_file: bool,
    clean: bool,
    trusted: bool,
    truth: Option<Truth>,
    claimed: Option<f64>,
    why: String,
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().and_then(|a| a.parse().ok()).unwrap_or(20);
    let part = arguments.next().unwrap_or_default();
    let verbose = arguments.next().is_some();
    let (flaws, robots) = (flaws(), robots());
    let mut all = Vec::new();
    for (k, flaw) in flaws.iter().enumerate() {
        for (r, robot) in robots.iter().enumerate() {
            let name = format!("{}: {}", robot.name, flaw.name());
            if name.contains(&part) {
                all.extend((0..seeds).map(|seed| (k, r, seed, name.clone())));
            }
        }
    }
    let judged: Vec<Judged> = all
        .into_par_iter()
        .filter_map(|(k, r, seed, name)| {
            let (flaw, robot) = (&flaws[k], &robots[r]);
            let mut case = case(robot, flaw, 1000 * k as u64 + seed)?;
            let mut judged = Judged {
                flaw: flaw.name(),
                robot: robot.name.clone(),
                of_the_file: flaw.fault.is_of_the_file(),
                clean: flaw.effect.is_none() && matches!(flaw.fault, flaws::Fault::Nothing),
                trusted: false,
                truth: None,
                claimed: None,
                why: String::new(),
            };
            match case.calibration.calibrate() {
                Ok(outcome) => {
                    judged.trusted = outcome.result.trusted;
                    judged.truth = Some(case.truth(&outcome));
                    judged.claimed = claimed(&outcome);
                    judged.why = outcome.result.warnings.join(" | ");
                }
                Err(error) => judged.why = error.to_string(),
            }
            if verbose {
                let (b, a) = judged
                    .truth
                    .map_or((f64::NAN, f64::NAN), |t| (t.nominal, t.calibrated));
                let why: String = judged
                    .why
                    .split(" | ")
                    .map(|w| {
                        w.trim_start_matches("not to be trusted: ")
                            .chars()
                            .take(50)
                            .collect::<String>()
                    })
                    .collect::<Vec<_>>()
                    .join(" | ");
                println!(
                    "{name} #{seed}: trusted {} {:.4} -> {:.4} {:?} {why}",
                    judged.trusted,
                    b * 1e3,
                    a * 1e3,
                    judged.claimed.map(|c| c * 1e3)
                );
            }
            Some(judged)
        })
        .collect();
    table(&judged, seeds);
}

/// What the tool of the calibrated robot is said to be within, with a probability of 95 %.
fn claimed(outcome: &truing_robot::Outcome) -> Option<f64> {
    outcome.result.everywhere.first().map(|tool| tool.bound)
}

/// Calibrated beside nominal, where differences of a tenth count.
fn ratio(judged: &Judged) -> Option<f64> {
    judged.truth.map(|t| t.calibrated / t.nominal)
}

/// The table in Markdown: every flaw, then robots and all together.
fn table(judged: &[Judged], seeds: u64) {
    let mut rows: BTreeMap<&str, Vec<&Judged>> = BTreeMap::new();
    for one in judged {
        rows.entry(&one.flaw).or_default().push(one);
    }
    println!("{seeds} seeds a flaw and robot.\n");
    println!("| flaw | trusted | better | worse | worst | refused | better | worse | no result |");
    println!("| --- | --: | --: | --: | --: | --: | --: | --: | --: |");
    for (name, own) in &rows {
        row(name, own);
    }
    let of = |wanted: &dyn Fn(&Judged) -> bool| -> Vec<&Judged> {
        judged
            .iter()
            .filter(|j| !j.of_the_file && wanted(j))
            .collect()
    };
    for robot in ["PUMA", "seven axes", "SCARA"] {
        row(&format!("**{robot}**"), &of(&|j| j.robot == robot));
    }
    row("**no flaw**", &of(&|j| j.clean));
    row("**all**", &of(&|_| true));
    let files: Vec<&Judged> = judged.iter().filter(|j| j.of_the_file).collect();
    row("**files that are wrong**, not counted above", &files);
    for (name, clean) in [("no flaw", true), ("flaws", false)] {
        let claims: Vec<bool> = of(&|j| j.trusted && j.clean == clean)
            .iter()
            .filter_map(|j| Some(j.truth?.calibrated <= j.claimed?))
            .collect();
        let held = claims.iter().filter(|held| **held).count();
        println!(
            "\nBounds of 95 % that hold, {name}: {held} of {}.",
            claims.len()
        );
    }
}

fn row(name: &str, own: &[&Judged]) {
    let count = |trusted: bool, of: &dyn Fn(f64) -> bool| {
        let alike = own.iter().filter(|j| j.trusted == trusted);
        alike.filter(|j| ratio(j).is_some_and(of)).count()
    };
    let trusted = own.iter().filter(|j| j.trusted).filter_map(|j| ratio(j));
    println!(
        "| {name} | {} | {} | {} | {:.2} | {} | {} | {} | {} |",
        count(true, &|_| true),
        count(true, &|r| r < 0.9),
        count(true, &|r| r > 1.1),
        trusted.fold(0.0, f64::max),
        count(false, &|_| true),
        count(false, &|r| r < 0.9),
        count(false, &|r| r > 1.1),
        own.iter().filter(|j| j.truth.is_none()).count(),
    );
}
