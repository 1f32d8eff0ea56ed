//! The program `truing`, with the planar methods as its plugin.

use std::process::ExitCode;
use truing_planar::Planar;

fn main() -> ExitCode {
    truing_cli::main_with(&[&Planar])
}
