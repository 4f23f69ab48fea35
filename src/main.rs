//! The command line: `epsplat render`, `compare`, `generate`, `info` and `adapters`.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::run()
}
