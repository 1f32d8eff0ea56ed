//! The calibration cell of the tests of `truing-robot`, and the program run on it.

#![allow(dead_code, reason = "each test file uses what it needs")]

#[path = "../../crates/truing-robot/tests/support/cell.rs"]
mod folder;

pub use folder::*;

use std::process::{Command, Stdio};

impl Cell {
    /// The program, to be run in the folder of the cell.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_truing"));
        command
            .args(arguments)
            .current_dir(self.folder())
            .stdin(Stdio::null());
        command
    }

    /// Runs the program in the folder of the cell.
    pub fn run(&self, arguments: &[&str]) -> Run {
        Run::of(self.command(arguments).output().unwrap())
    }

    /// Runs `truing calibrate calibration.toml --json` and reads what it printed; exit status 0.
    #[track_caller]
    pub fn calibrate(&self) -> serde_json::Value {
        let run = self.run(&["calibrate", "calibration.toml", "--json"]);
        assert_eq!(run.status, 0, "{}", run.stderr);
        run.json()
    }

    /// The same of a result that must not be trusted; exit status 1.
    #[track_caller]
    pub fn distrusted(&self) -> serde_json::Value {
        let run = self.run(&["calibrate", "calibration.toml", "--json"]);
        assert_eq!(run.status, 1, "{}", run.stderr);
        run.json()
    }
}

/// What a run of the program left.
#[derive(Debug)]
pub struct Run {
    /// Exit status.
    pub status: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

impl Run {
    /// Of a process that ended by itself and printed UTF-8.
    pub fn of(output: std::process::Output) -> Self {
        Self {
            status: output.status.code().expect("not ended by a signal"),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Standard output as JSON.
    #[track_caller]
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|error| panic!("{error} in {}", self.stdout))
    }
}
