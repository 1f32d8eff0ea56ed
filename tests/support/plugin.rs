//! Tests of a plugin that run `truing` with it: the test's own executable is the program, too.

#![allow(dead_code, reason = "each test file uses what it needs")]

use libtest_mimic::{Arguments, Trial};
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
