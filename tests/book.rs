//! The book shows what there is: every printed output is that of the command above it, every file it
//! shows can be read, every piece it includes and every page it links to exists.
//!
//! After a change of the output, `SNAPSHOTS=overwrite cargo test --test book` rewrites what is shown.

#![allow(
    dead_code,
    reason = "an example's `main` is its own, the book shows its `run`"
)]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use truing_planar::Planar;
use truing_robot::Registry;
use truing_robot::file::{CalibrationFile, SimulationFile, StudyFile};
use truing_robot::robot::RobotFile;

#[path = "../crates/truing/examples/arc.rs"]
mod arc;
#[path = "../crates/truing/examples/bounds.rs"]
mod bounds;
#[path = "../crates/truing/examples/curve_fitting.rs"]
mod curve_fitting;
#[path = "../examples/custom_constraint.rs"]
mod custom_constraint;
#[path = "../crates/truing-robot/examples/kinds.rs"]
mod kinds;
#[path = "../crates/truing/examples/lbfgs.rs"]
mod lbfgs;
#[path = "../examples/mixed_constraints.rs"]
mod mixed_constraints;
#[path = "../crates/truing-robot/examples/tool_uncertainty.rs"]
mod tool_uncertainty;

fn top() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn source() -> PathBuf {
    top().join("book/src")
}

fn files_in(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .collect();
    files.sort();
    assert!(!files.is_empty(), "no {extension} in {}", folder.display());
    files
}

/// A folder in which the commands of the book run: the example, and the book's own files.
fn workplace() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for sub in [
        "puma560",
        "puma560/data",
        "planar",
        "planar/data",
        "studies",
    ] {
        let from = top().join("examples").join(sub);
        let to = folder.path().join("examples").join(sub);
        fs::create_dir_all(&to).unwrap();
        for entry in fs::read_dir(from).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
            }
        }
    }
    for path in files_in(&source().join("files"), "toml") {
        fs::copy(&path, folder.path().join(path.file_name().unwrap())).unwrap();
    }
    folder
}

/// Runs a command as the book writes it; returns what it prints.
fn run(command: &str, folder: &Path, status: &mut i32) -> String {
    let words: Vec<&str> = command.split_whitespace().collect();
    match words.as_slice() {
        [quiet @ .., ">", file] => {
            let printed = run(&quiet.join(" "), folder, status);
            fs::write(folder.join(file), printed).unwrap();
            String::new()
        }
        ["truing", arguments @ ..] => {
            let output = Command::new(env!("CARGO_BIN_EXE_truing"))
                .args(arguments)
                .current_dir(folder)
                .env_remove("RUST_LOG")
                .output()
                .unwrap();
            *status = output.status.code().unwrap();
            String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap()
        }
        ["cargo", "run", "--quiet", "--example", name] => {
            let mut out = Vec::new();
            match *name {
                "mixed_constraints" => drop(mixed_constraints::run(&mut out).unwrap()),
                "bounds" => drop(bounds::run(&mut out).unwrap()),
                "lbfgs" => drop(lbfgs::run(&mut out).unwrap()),
                "curve_fitting" => drop(curve_fitting::run(&mut out).unwrap()),
                "kinds" => drop(kinds::run(&mut out).unwrap()),
                "custom_constraint" => drop(custom_constraint::run(&mut out).unwrap()),
                "arc" => drop(arc::run(&mut out).unwrap()),
                "tool_uncertainty" => drop(tool_uncertainty::run(&mut out).unwrap()),
                other => panic!("the book runs no example `{other}`"),
            }
            String::from_utf8(out).unwrap()
        }
        ["head", "-n", count, file] => {
            let text = fs::read_to_string(folder.join(file)).unwrap();
            let lines = text.lines().take(count.parse().unwrap());
            lines.map(|line| format!("{line}\n")).collect()
        }
        ["echo", "$?"] => format!("{status}\n"),
        _ => panic!("the book shows a command that this test cannot run: {command}"),
    }
}

/// What may differ between processors, and only that.
///
/// Sums are taken in another order with wider vector units, so the last bits of a sum differ. An
/// estimate is then the same to about ten digits, but a digit printed at the edge of rounding can
/// turn: a number with a point may differ by one in its last digit, or by 1e-7 of itself where all
/// digits are printed. What is left at convergence is rounding itself, and so is which test of
/// convergence sees it first: how a solver converged is not compared, and the numbers of iterations and
/// evaluations may differ by one.
fn same(expected: &str, found: &str) -> Result<(), String> {
    let (e, f): (Vec<&str>, Vec<&str>) = (expected.lines().collect(), found.lines().collect());
    for k in 0..e.len().max(f.len()) {
        let (e, f) = (
            e.get(k).copied().unwrap_or(""),
            f.get(k).copied().unwrap_or(""),
        );
        if !same_line(e, f) {
            return Err(format!("line {}:\n  book  {e}\n  found {f}", k + 1));
        }
    }
    Ok(())
}

fn same_line(expected: &str, found: &str) -> bool {
    let (e, f) = (tokens(expected), tokens(found));
    e.len() == f.len()
        && (0..e.len()).all(|k| {
            let counts = ["iterations", "residual", "Jacobian"];
            let counted = e
                .get(k + 2)
                .is_some_and(|next| counts.contains(&next.as_str()));
            e[k] == f[k] || same_number(&e[k], &f[k], counted)
        })
}

/// Words, numbers and single signs; spaces that align columns do not count, and how a solver
/// converged is left out.
fn tokens(line: &str) -> Vec<String> {
    let mut text = line.split_whitespace().collect::<Vec<_>>().join(" ");
    if let Some((before, after)) = text.split_once("converged: ")
        && !before.ends_with("not ")
        && let Some((_, after)) = after.split_once(')')
    {
        text = format!("{before}converged{after}");
    }
    let mut tokens = vec![String::new()];
    let mut previous = ' ';
    for c in text.chars() {
        let number = c.is_alphanumeric() || c == '.' || (c == '-' && previous == 'e');
        if !number || !(previous.is_alphanumeric() || previous == '.' || previous == '-') {
            tokens.push(String::new());
        }
        if let Some(last) = tokens.last_mut() {
            last.push(c);
        }
        previous = c;
    }
    tokens
}

fn same_number(expected: &str, found: &str, counted: bool) -> bool {
    let (Ok(e), Ok(f)) = (expected.parse::<f64>(), found.parse::<f64>()) else {
        return false;
    };
    let (mantissa, exponent) = expected.split_once('e').unwrap_or((expected, "0"));
    let Some((_, decimals)) = mantissa.split_once('.') else {
        return counted && (e - f).abs() <= 1.0;
    };
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let last_digit = 10_f64.powi(exponent - decimals.len() as i32);
    (e - f).abs() <= (1.01 * last_digit).max(1e-7 * e.abs())
}

#[test]
fn the_comparison_forgives_rounding_and_nothing_else() {
    let line = "converged: the steps are small (1e-15 ≤ 1e-14) after 5 iterations, cost 1.234500e1";
    for other in [
        "converged: the gradient is zero (2e-13 ≤ 1e-12) after 6 iterations, cost 1.234500e1",
        "converged: the steps are small (1e-15 ≤ 1e-14) after 5 iterations, cost 1.234501e1",
    ] {
        assert!(same_line(line, other), "{other}");
    }
    for other in [
        "not converged: the steps are small (1e-15 ≤ 1e-14) after 5 iterations, cost 1.234500e1",
        "converged: the steps are small (1e-15 ≤ 1e-14) after 8 iterations, cost 1.234500e1",
        "converged: the steps are small (1e-15 ≤ 1e-14) after 5 iterations, cost 1.234600e1",
        "converged: the steps are small (1e-15 ≤ 1e-14) after 5 iterations, price 1.234500e1",
    ] {
        assert!(!same_line(line, other), "{other}");
    }
    assert!(same_line("  d2   0.1602 −", " d2 0.1603  −"));
    assert!(!same_line("d2 0.1602 mm", "d3 0.1602 mm"));
    assert!(!same_line("20 of 37 parameters", "21 of 37 parameters"));
    assert!(!same_line("x -0.5", "x 0.5"));
}

/// The output without numbers, where a command measures times and rounding.
fn timeless(output: &str) -> String {
    if !output.starts_with("$ truing check") {
        return output.to_owned();
    }
    let (command, rest) = output.split_once('\n').unwrap_or((output, ""));
    let words = rest.lines().map(|line| {
        let words = line.split_whitespace();
        let plain = words.filter(|word| !word.contains(|c: char| c.is_ascii_digit()));
        plain.collect::<Vec<_>>().join(" ")
    });
    format!("{command}\n{}", words.collect::<Vec<_>>().join("\n"))
}

#[test]
fn every_output_is_that_of_its_command() {
    for path in files_in(&source().join("output"), "txt") {
        let shown = fs::read_to_string(&path).unwrap();
        let folder = workplace();
        let mut status = 0;
        let mut found = String::new();
        for command in shown.lines().filter_map(|line| line.strip_prefix("$ ")) {
            let _ = writeln!(found, "$ {command}");
            found += &run(command, folder.path(), &mut status);
        }
        if std::env::var_os("SNAPSHOTS").is_some_and(|word| word == "overwrite") {
            fs::write(&path, found).unwrap();
        } else if let Err(difference) = same(&timeless(&shown), &timeless(&found)) {
            panic!(
                "{} is out of date, {difference}\n(SNAPSHOTS=overwrite cargo test --test book rewrites it)",
                path.display()
            );
        }
    }
}

#[test]
fn every_file_that_is_shown_can_be_read() {
    let registry = Registry::with(&[&Planar]);
    for path in files_in(&source().join("files"), "toml") {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let read = match name.split('-').next().unwrap() {
            "robot" => RobotFile::read(&path).map(drop),
            "calibration" => CalibrationFile::read_with(&path, &registry).map(drop),
            "simulation" => SimulationFile::read(&path).map(drop),
            "study" => StudyFile::read_with(&path, &registry).map(drop),
            // Wrong on purpose: its message is shown.
            "misspelt" => {
                assert!(CalibrationFile::read_with(&path, &registry).is_err());
                Ok(())
            }
            other => panic!("what is {other}?"),
        };
        if let Err(error) = read {
            panic!("{error}");
        }
    }
}

/// The id that a heading gets in the built book.
fn id(heading: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || c == '-' || c == '_';
    let dashed = heading.trim().to_lowercase().replace(' ', "-");
    dashed.chars().filter(|c| plain(*c)).collect()
}

fn headings(page: &str) -> Vec<String> {
    let lines = page.lines().filter(|line| line.starts_with('#'));
    lines.map(|line| id(line.trim_start_matches('#'))).collect()
}

/// What stands between two signs, everywhere in a text.
fn between<'t>(text: &'t str, open: &str, close: char) -> Vec<&'t str> {
    let pieces = text.split(open).skip(1);
    pieces
        .filter_map(|piece| piece.split_once(close))
        .map(|(found, _)| found)
        .collect()
}

#[test]
fn every_page_and_every_link_leads_somewhere() {
    let mut listed = Vec::new();
    for page in files_in(&source(), "md") {
        let text = fs::read_to_string(&page).unwrap();
        let name = page.file_name().unwrap().to_string_lossy().into_owned();
        for link in between(&text, "](", ')') {
            if link.contains("://") {
                continue;
            }
            let (file, fragment) = link.split_once('#').unwrap_or((link, ""));
            let target = if file.is_empty() {
                page.clone()
            } else {
                source().join(file)
            };
            assert!(target.is_file(), "{name}: no page {link}");
            if !fragment.is_empty() {
                let there = headings(&fs::read_to_string(&target).unwrap());
                assert!(
                    there.iter().any(|id| id == fragment),
                    "{name}: no heading {link}"
                );
            }
            if name == "SUMMARY.md" {
                listed.push(file.to_owned());
            }
        }
    }
    for page in files_in(&source(), "md") {
        let name = page.file_name().unwrap().to_string_lossy().into_owned();
        assert!(
            name == "SUMMARY.md" || listed.contains(&name),
            "{name} is not in the summary"
        );
    }
}

#[test]
fn every_code_block_is_a_piece_of_a_file_that_the_tests_run() {
    for page in files_in(&source(), "md") {
        let text = fs::read_to_string(&page).unwrap();
        let name = page.file_name().unwrap().to_string_lossy().into_owned();
        let mut inside = false;
        for line in text.lines() {
            if line.starts_with("```") {
                inside = !inside;
            } else if inside {
                assert!(
                    line.starts_with("{{#include "),
                    "{name}: written by hand: {line}"
                );
            }
        }
        assert!(!inside, "{name}: a code block without an end");
        for include in between(&text, "{{#include ", '}') {
            let (file, piece) = include.split_once(':').unwrap_or((include, ""));
            let path = source().join(file);
            let content =
                fs::read_to_string(&path).unwrap_or_else(|error| panic!("{name}: {file}: {error}"));
            let run = [
                "../../crates/truing/examples/",
                "../../crates/truing-robot/examples/",
                "../../examples/",
                "../../tests/",
                "../../examples/puma560/",
                "../../examples/planar/",
                "output/",
                "files/",
            ];
            assert!(
                run.iter().any(|folder| file.starts_with(folder)),
                "{name}: no test runs {file}"
            );
            let lines = content.lines().count();
            let range: Vec<&str> = piece.split(':').filter(|part| !part.is_empty()).collect();
            for part in range {
                let there = match part.parse::<usize>() {
                    Ok(line) => (1..=lines).contains(&line),
                    Err(_) => {
                        content.contains(&format!("// ANCHOR: {part}\n"))
                            && content.contains(&format!("// ANCHOR_END: {part}\n"))
                    }
                };
                assert!(there, "{name}: {file} has no {part}");
            }
        }
    }
}
