//! The command line: one file for each subcommand. All computation is in the library.

mod adapters;
mod bench;
mod cameras;
mod card;
mod compare;
mod coverage;
mod generate;
mod hardcases;
mod hybrid;
mod info;
mod inputs;
mod lod;
mod merge;
mod outputs;
mod progress;
mod render;
mod sample;
mod signals;
mod simplify;
mod surfels;
mod visible;

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use epsplat::low_level::network::mpi::Job;
use epsplat::{Error, Result};
use serde::Serialize;

/// Render point clouds, surfels, meshes and Gaussian surfels without a display.
#[derive(Parser)]
#[command(version, max_term_width = 110, after_help = AFTER_HELP)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

const AFTER_HELP: &str = "\
Measuring:
  bench      Run a study of speed beside error: every configuration on every scene of a TOML file
  hardcases  Render hard scenes with every accumulator and judge each pixel by a derived bound
  card       Make a record of an adapter in limited time: accuracy, equal bits, speed
  adapters   List the adapters, with their limits and features, and the one that auto selects

Exit codes: 0 done, 1 the run failed, 2 the arguments cannot be used.";

#[derive(Subcommand)]
enum Command {
    Render(Box<render::Arguments>),
    Merge(merge::Arguments),
    Info(info::Arguments),
    Surfels(surfels::Arguments),
    Visible(visible::Arguments),
    Sample(sample::Arguments),
    Simplify(simplify::Arguments),
    Hybrid(hybrid::Arguments),
    Lod(lod::Arguments),
    Coverage(coverage::Arguments),
    Compare(compare::Arguments),
    Generate(generate::Arguments),
    #[command(hide = true)]
    Bench(bench::Arguments),
    #[command(hide = true)]
    Hardcases(hardcases::Arguments),
    #[command(hide = true)]
    Card(card::Arguments),
    #[command(hide = true)]
    Adapters(adapters::Arguments),
}

/// Parses the arguments, runs the subcommand, and returns its exit code after printing any error.
pub fn run() -> ExitCode {
    signals::watch();
    let arguments = Arguments::try_parse().unwrap_or_else(|error| {
        // All processes of a job have the same arguments, and the first one prints what is wrong.
        let is_told = Job::of(|name| std::env::var(name).ok()).is_none_or(|job| job.rank == 0);
        if is_told { error.exit() } else { std::process::exit(error.exit_code()) }
    });
    let outcome = match arguments.command {
        Command::Render(arguments) => render::run(&arguments),
        Command::Merge(arguments) => merge::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Coverage(arguments) => coverage::run(&arguments),
        Command::Generate(arguments) => generate::run(&arguments),
        Command::Surfels(arguments) => surfels::run(&arguments),
        Command::Visible(arguments) => visible::run(&arguments),
        Command::Sample(arguments) => sample::run(&arguments),
        Command::Info(arguments) => info::run(&arguments),
        Command::Adapters(arguments) => adapters::run(&arguments),
        Command::Hardcases(arguments) => hardcases::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
        Command::Card(arguments) => card::run(&arguments),
        Command::Simplify(arguments) => simplify::run(&arguments),
        Command::Hybrid(arguments) => hybrid::run(&arguments),
        Command::Lod(arguments) => lod::run(&arguments),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        // The process that failed prints why.
        Err(error @ Error::OtherProcess { .. }) => ExitCode::from(error.exit_code()),
        Err(error) => {
            // `eprintln!` would panic if stderr is closed.
            let _ = writeln!(std::io::stderr(), "error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// Prints a note or a warning, one line, to stderr. Ignores a closed stderr.
fn note(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Prints `text` to stdout. A closed pipe is not an error.
fn print(text: &str) -> Result<()> {
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Error::write(Path::new("standard output"), e)),
        _ => Ok(()),
    }
}

/// Writes `value` as JSON to the file at `path`, or to stdout for `-`.
fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut text = serde_json::to_string_pretty(value).map_err(|e| Error::write(path, e.into()))?;
    text.push('\n');
    if path == Path::new("-") {
        print(&text)
    } else {
        epsplat::io::atomic::write_whole(path, |file| file.write_all(text.as_bytes()))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clap::CommandFactory;

    use super::Arguments;

    /// Clap detects duplicate names only in debug builds. A duplicate would take the other's text.
    #[test]
    fn no_two_arguments_of_a_command_have_one_name() {
        for command in Arguments::command().get_subcommands() {
            let names = |of: fn(&clap::Arg) -> Option<&str>| {
                let all: Vec<&str> = command.get_arguments().filter_map(of).collect();
                assert_eq!(all.iter().collect::<BTreeSet<_>>().len(), all.len(), "{}: {all:?}", command.get_name());
            };
            names(|argument| Some(argument.get_id().as_str()));
            names(clap::Arg::get_long);
        }
    }
}
