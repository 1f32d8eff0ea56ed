//! The program `truing` as a library: arguments, files, printing; no mathematics.
//!
//! A program with plugins of one's own is [`main_with`] and no more: its files can then name kinds of
//! measurement, methods and losses that the plugins bring.

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
mod streams;
mod study;
mod words;

use args::{Arguments, Command};
use clap::Parser;
use failure::Failure;
use std::ffi::OsString;
use std::io::IsTerminal;
use std::process::ExitCode;
use streams::{Ending, Streams};
use truing_robot::{Plugin, Registry};

/// The program with plugins: all that a `main` of anyone's needs.
///
/// Nothing is added to the plugins given: what comes first is found first.
///
/// ```no_run
/// use std::process::ExitCode;
/// use truing_robot::Plugin;
///
/// struct Mine;
///
/// impl Plugin for Mine {}
///
/// fn main() -> ExitCode {
///     truing_cli::main_with(&[&Mine])
/// }
/// ```
pub fn main_with(plugins: &[&dyn Plugin]) -> ExitCode {
    main_from(std::env::args_os(), plugins)
}

/// The same with arguments of one's own, the first of which is the name of the program.
pub fn main_from(
    arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>,
    plugins: &[&dyn Plugin],
) -> ExitCode {
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and the version are no errors: clap knows which stream and which status each has.
            let _ = error.print();
            return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
        }
    };
    let level = match arguments.verbose {
        0 => tracing::Level::WARN,
        1 => tracing::Level::INFO,
        _ => tracing::Level::DEBUG,
    };
    // A program that has its own subscriber keeps it.
    let _ = tracing_subscriber::fmt()
        .with_max_level(level)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(false)
        .without_time()
        .try_init();
    let streams = Streams {
        json: arguments.json,
        registry: Registry::with(plugins),
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
