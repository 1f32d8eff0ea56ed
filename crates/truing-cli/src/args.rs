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
    /// Say what measurements can identify, and what they cannot see.
    Identify(Identify),
    /// Make data by simulating robots with known errors.
    Simulate(Simulate),
    /// Find out how often methods recover robots: a Monte-Carlo study.
    Study(Study),
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

/// Say what measurements can identify, and what they cannot see.
///
/// Of a calibration file: what its constraints identify by structure (at random configurations that
/// satisfy them exactly), and what its data excite. Of a robot file: what measurements of the kinds
/// asked about would identify, at random configurations.
///
/// Exit status: 0 answered; 2 bad input.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  truing identify calibration.toml
  truing identify robot.toml --kind unknown-plane
  truing identify robot.toml --kind position --frame tracker --target reflector
  truing identify robot.toml --plane 0,0,1,0.4 --plane 1,0,0,0.3 --planes 2
  truing identify robot.toml --kind position --parameters all --preference r3")]
pub struct Identify {
    /// Calibration file or robot file (TOML).
    pub file: PathBuf,

    /// What would be measured: position, pose, known-plane, unknown-plane, same-point or distance;
    /// once for each kind. Planes, points and distances are drawn within reach.
    #[arg(long = "kind", value_name = "KIND", help_heading = ROBOT)]
    pub kinds: Vec<String>,

    /// Touches of a known plane, nx·x + ny·y + nz·z = d in metres; once for each plane.
    #[arg(long = "plane", value_name = "NX,NY,NZ,D", allow_hyphen_values = true, help_heading = ROBOT)]
    pub planes: Vec<String>,

    /// How many random planes: unknown ones, or with `--kind known-plane` alone known ones.
    #[arg(long = "planes", value_name = "N", value_parser = clap::value_parser!(u8).range(1..=20), help_heading = ROBOT)]
    pub random_planes: Option<u8>,

    /// Positions and poses are read in a sensor frame of this name, which is estimated too.
    #[arg(long, value_name = "NAME", help_heading = ROBOT)]
    pub frame: Option<String>,

    /// What is measured is a tool point of this name, which is estimated too, not the tool origin.
    #[arg(long, value_name = "NAME", help_heading = ROBOT)]
    pub target: Option<String>,

    /// Parameters in question, by names and patterns as in a calibration file (`all`, `base`, `tool`,
    /// `gains`, `theta*`). All but the gains if left out; `all` has the gains too.
    #[arg(long, value_name = "PATTERN", num_args = 1.., value_delimiter = ',', help_heading = ROBOT)]
    pub parameters: Vec<String>,

    /// Parameters that are fixed.
    #[arg(long, value_name = "PATTERN", num_args = 1.., value_delimiter = ',', help_heading = ROBOT)]
    pub fixed: Vec<String>,

    /// Parameters to keep rather than others, the preferred first; the rest follow in the default order.
    #[arg(long, value_name = "PATTERN", num_args = 1.., value_delimiter = ',', help_heading = ROBOT)]
    pub preference: Vec<String>,

    /// Seed of the random configurations.
    #[arg(long)]
    pub seed: Option<u64>,
}

/// Heading of arguments that a calibration file says itself.
const ROBOT: &str = "For a robot file";

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

/// Find out how often methods recover robots: a Monte-Carlo study.
#[derive(Debug, Args)]
pub struct Study {
    /// Study file (TOML): robot, errors, what is measured, methods.
    pub file: PathBuf,

    /// Folder for study.json, study.csv and study.svg; made if it is not there.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,

    /// Write into a folder that is already there.
    #[arg(long)]
    pub force: bool,

    /// Threads; all processors by default. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// Trials for each case and tool error, instead of those in the file.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub trials: Option<u32>,

    /// Seed, instead of the one in the file.
    #[arg(long)]
    pub seed: Option<u64>,
}
