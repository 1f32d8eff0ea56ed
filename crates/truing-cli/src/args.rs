//! Arguments of the program.

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// Makes robots true to their measurements.
///
/// Exit status: 0 all is well; 1 there is an answer, and it says why not to rely on it; 2 bad input.
#[derive(Debug, Parser)]
#[command(name = "truing", version, max_term_width = 100)]
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

// A comment on a variant would hide that of its arguments from `--help`.
/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    Calibrate(Calibrate),
    Check(Check),
    Identify(Identify),
    Simulate(Simulate),
    Study(Study),
}

/// Calibrate robots from measurements.
///
/// Exit status: 0 converged, and to be trusted; 1 not converged, or not to be trusted (it says why);
/// 2 bad input.
#[derive(Debug, Args)]
pub struct Calibrate {
    /// Calibration file (TOML): robots, what to estimate, constraints and their data.
    pub file: PathBuf,

    /// Folder for result.json, the calibrated robot.toml, residuals.csv and report.html; made if it is not
    /// there.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,

    /// Write into a folder that holds something already, and also if the result must not be trusted.
    #[arg(long)]
    pub force: bool,

    /// Write the files also if the result must not be trusted, but only into a new or an empty folder.
    #[arg(long)]
    pub keep_untrusted: bool,

    /// Stop after this many seconds with the best point so far.
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..))]
    pub timeout: Option<u64>,
}

/// Compare automatic, analytic and numeric Jacobians on a calibration file.
///
/// Each is compared with frame-wise automatic differentiation (`auto`), column by column, and timed.
///
/// Exit status: 0 all agree; 1 some differ; 2 bad input.
#[derive(Debug, Args)]
pub struct Check {
    /// Calibration file (TOML); its data say at which joint values.
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

    /// What would be measured: position, pose, known-plane, unknown-plane, same-point, same-location,
    /// distance, ball-bar or a plugin's; once for each kind. Planes, points, locations and distances are drawn within
    /// reach.
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
///
/// Exit status: 0 written; 2 bad input.
#[derive(Debug, Args)]
pub struct Simulate {
    /// Simulation file (TOML): robots, their errors, what is measured.
    pub file: PathBuf,

    /// Folder for the data, a calibration file for them and the true robots; made if it is not there.
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,

    /// Write into a folder that holds something already.
    #[arg(long)]
    pub force: bool,

    /// Seed, instead of the one in the file.
    #[arg(long)]
    pub seed: Option<u64>,
}

/// Find out how often methods recover robots: a Monte-Carlo study.
///
/// True robots are drawn, measured and estimated again by every method, many times. Ctrl-C ends it after
/// the trials under way: they are reported, and nothing is written.
///
/// Exit status: 0 all trials were run; 1 stopped before; 2 bad input.
#[derive(Debug, Args)]
pub struct Study {
    /// Study file (TOML): robot, errors, what is measured, methods.
    pub file: PathBuf,

    /// Folder for study.json, study.csv and study.svg; made if it is not there.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,

    /// Write into a folder that holds something already.
    #[arg(long)]
    pub force: bool,

    /// How many threads; by default one for each processor. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,

    /// Trials for each case and tool error, instead of those in the file.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub trials: Option<u32>,

    /// Seed, instead of the one in the file.
    #[arg(long)]
    pub seed: Option<u64>,
}
