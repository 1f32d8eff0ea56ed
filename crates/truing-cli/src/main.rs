//! The program `truing`: arguments, files, printing; no mathematics.

mod args;
mod calibrate;
mod check;
mod failure;
mod figure;
mod identify;
mod interrupt;
mod output;
mod report;
mod show;
mod show_identify;
mod show_statistics;
mod simulate;
mod study;

use args::{Arguments, Command};
use clap::Parser;
use failure::Failure;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;

/// How a command ended that ran to its end.
pub enum Ending {
    /// Converged, or agrees: exit status 0.
    Good,
    /// Did not converge, must not be trusted or does not agree: exit status 1.
    Untrusted,
    /// Stopped before its end: exit status 1.
    Stopped,
}

/// Where output goes: data to standard output, words to standard output or, beside JSON, to standard error.
pub struct Streams {
    json: bool,
}

impl Streams {
    /// Words for people.
    pub fn say(&self, text: &str) {
        // A reader that hung up (`truing … | head`) is no failure.
        let _ = if self.json {
            std::io::stderr().write_all(text.as_bytes())
        } else {
            std::io::stdout().write_all(text.as_bytes())
        };
    }

    /// Data for machines.
    pub fn print(&self, text: &str) {
        let _ = std::io::stdout().write_all(text.as_bytes());
    }
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let level = match arguments.verbose {
        0 => tracing::Level::WARN,
        1 => tracing::Level::INFO,
        _ => tracing::Level::DEBUG,
    };
    tracing_subscriber::fmt()
        .with_max_level(level)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(false)
        .without_time()
        .init();
    let streams = Streams {
        json: arguments.json,
    };
    let ending = match &arguments.command {
        Command::Calibrate(arguments) => calibrate::run(arguments, &streams),
        Command::Check(arguments) => check::run(arguments, &streams),
        Command::Identify(arguments) => identify::run(arguments, &streams),
        Command::Simulate(arguments) => simulate::run(arguments, &streams),
        Command::Study(arguments) => study::run(arguments, &streams),
    };
    match ending {
        Ok(Ending::Good) => ExitCode::SUCCESS,
        Ok(Ending::Untrusted | Ending::Stopped) => ExitCode::from(1),
        Err(failure) => {
            report(&failure, &streams);
            ExitCode::from(2)
        }
    }
}

fn report(failure: &Failure, streams: &Streams) {
    if streams.json {
        streams.print(&(failure.json() + "\n"));
    }
    eprint!("{}", failure::Shown(failure));
}
