//! The program `truing`, with the planar methods as its plugin.

use std::process::ExitCode;

fn main() -> ExitCode {
    truing_cli::main_with(&[&truing_planar::Planar])
}
