//! Tests of a plugin that run `truing` with it: the test's own executable is the program, too.

#![allow(dead_code, reason = "each test file uses what it needs")]

use libtest_mimic::{Arguments, Trial};
use std::fs;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use truing_robot::Plugin;

/// The first argument where the executable is to be the program.
const AS_PROGRAM: &str = "as-truing";

/// The robot of the shipped example.
pub const ROBOT: &str = include_str!("../../examples/puma560/puma560.toml");

/// A test file's `main`: the program with the plugins, or the tests.
pub fn main(plugins: &[&dyn Plugin], tests: &[(&'static str, fn())]) -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    if arguments.get(1).is_some_and(|first| first == AS_PROGRAM) {
        let program = [arguments[0].clone()].into_iter();
        return truing_cli::main_from(program.chain(arguments.into_iter().skip(2)), plugins);
    }
    let trial = |(name, test): &(&'static str, fn())| {
        let test = *test;
        Trial::test(*name, move || {
            test();
            Ok(())
        })
    };
    libtest_mimic::run(&Arguments::from_args(), tests.iter().map(trial).collect()).exit_code()
}

/// Runs the program in a folder; its exit status, standard output and standard error.
pub fn truing(folder: &Path, arguments: &str) -> (i32, String, String) {
    let output = Command::new(std::env::current_exe().unwrap())
        .arg(AS_PROGRAM)
        .args(arguments.split_whitespace())
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let status = output.status.code().expect("not ended by a signal");
    (status, text(output.stdout), text(output.stderr))
}

/// The same where it must end with status 0; its standard output.
#[track_caller]
pub fn succeeds(folder: &Path, arguments: &str) -> String {
    let (status, out, error) = truing(folder, arguments);
    assert_eq!(status, 0, "truing {arguments}\n{out}\n{error}");
    out
}

/// The same, where the output is JSON.
#[track_caller]
pub fn json(folder: &Path, arguments: &str) -> serde_json::Value {
    let out = succeeds(folder, arguments);
    serde_json::from_str(&out).unwrap_or_else(|error| panic!("{error} in {out}"))
}

/// A folder with these files, and the robot of the shipped example as `robot.toml` if none of them is that.
pub fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [("robot.toml", ROBOT)].iter().chain(files) {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

/// The same, in which `simulation.toml` was simulated to the folder `data`.
#[track_caller]
pub fn simulated(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = folder(files);
    succeeds(folder.path(), "simulate simulation.toml --output data");
    folder
}

/// The parameter of a result, or of what was identified, with this name.
#[track_caller]
pub fn parameter<'r>(result: &'r serde_json::Value, name: &str) -> &'r serde_json::Value {
    let all = result["parameters"].as_array().unwrap();
    let found = all.iter().find(|p| p["name"] == name);
    found.unwrap_or_else(|| panic!("no {name} in {all:?}"))
}

/// A parameter's estimate and σ are those of a truth: not farther off than four σ, which is at most `sigma`.
#[track_caller]
pub fn assert_recovered(result: &serde_json::Value, name: &str, truth: f64, sigma: f64) {
    let found = parameter(result, name);
    let [estimate, s] = ["estimate", "sigma"].map(|key| found[key].as_f64().unwrap());
    assert!(s <= sigma, "{found}");
    assert!(
        (estimate - truth).abs() <= 4.0 * s,
        "{found}, truly {truth}"
    );
}

/// A small study of `robot.toml` with so many measurements of each kind is run, and its method recovers.
#[track_caller]
pub fn assert_studied(folder: &Path, kinds: &[(&str, usize)]) {
    let mut text = String::from(
        "seed = 7\ntrials = 2\nconfigurations = 20\n[robot]\nfile = \"robot.toml\"\n[estimate]\n\
         fixed = [\"gains\"]\n[errors]\nangle = \"0.1 deg\"\nlength = \"1 mm\"\n[[method]]\nname = \"Truing\"\n\
         [[case]]\nname = \"all together\"\n",
    );
    for (kind, count) in kinds {
        text += &format!(
            "[[case.constraint]]\nkind = \"{kind}\"\ncount = {count}\nsigma = \"0.05 mm\"\n"
        );
    }
    fs::write(folder.join("study.toml"), text).unwrap();
    let shown = succeeds(folder, "study study.toml --output study");
    assert!(shown.contains("all together"), "{shown}");
}
