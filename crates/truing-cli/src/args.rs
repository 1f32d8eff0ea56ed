//! Arguments of the program.

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Makes robots true to their measurements.
///
/// Exit status: 0 converged; 1 did not converge or must not be trusted (it says why); 2 bad input.
#[derive(Debug, Parser)]
#[command(name = "truing", version, about, long_about, max_term_width = 100)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,

    /// Print machine-readable JSON on standard output; text for people goes to standard error.
    #[arg(long, global = true)]
    pub json: bool,

    /// Say more (-v what is done, -vv details).
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    pub verbose: u8,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Calibrate robots from measurements.
    Calibrate(Calibrate),
    /// Compare automatic, analytic and numeric Jacobians on a calibration file.
    Check(Check),
    /// Make data by simulating robots with known errors.
    Simulate(Simulate),
}

/// Calibrate robots from measurements.
#[derive(Debug, Args)]
pub struct Calibrate {
    /// Calibration file (TOML): robots, what to estimate, constraints and their data.
    pub file: PathBuf,

    /// Folder for result.json, the calibrated robot.toml and report.html; made if it is not there.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,

    /// Write into a folder that is already there, and also if the result must not be trusted.
    #[arg(long)]
    pub force: bool,

    /// Write the files also if the result must not be trusted.
    #[arg(long)]
    pub keep_untrusted: bool,

    /// Stop after this many seconds with the best point so far.
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..))]
    pub timeout: Option<u64>,
}

/// Compare automatic, analytic and numeric Jacobians on a calibration file.
///
/// Exit status: 0 they agree; 1 they do not; 2 bad input.
#[derive(Debug, Args)]
pub struct Check {
    /// Calibration file (TOML).
    pub file: PathBuf,
}

/// Make data by simulating robots with known errors.
#[derive(Debug, Args)]
pub struct Simulate {
    /// Simulation file (TOML): robots, their errors, what is measured.
    pub file: PathBuf,

    /// Folder for the data and the true robots; made if it is not there.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,

    /// Write into a folder that is already there.
    #[arg(long)]
    pub force: bool,

    /// Seed, instead of the one in the file.
    #[arg(long)]
    pub seed: Option<u64>,
}
