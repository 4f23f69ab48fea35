//! `epsplat bench`: runs a study of speed and error that a TOML file defines.

use std::path::PathBuf;
use std::time::SystemTime;

use clap::Args;
use epsplat::io::atomic;
use epsplat::low_level::bench::{self, Definition, machine, table};
use epsplat::low_level::gpu::Gpu;
use epsplat::low_level::render::Backend;
use epsplat::low_level::report;
use epsplat::{Error, Result};

use super::outputs::Source;
use super::progress::Bars;
use super::{note, outputs, print};

/// Run a study of speed beside error: every configuration on every scene of a TOML file.
///
/// Runs of the configurations alternate, so a machine that slows down slows all of them. Errors are
/// measured against the f64 reference with the same options, except in pixels that the reference
/// excuses. Scenes that ask for it are also compared with ray-cast ground truth.
#[derive(Args)]
#[command(after_help = "Example:\n  epsplat bench benches/accumulators.toml --quick --out report\n\n\
    Exits with 1, after everything is written, if a configuration misses its error limit or, where its bits must not\n\
    change, gives different bits in two runs.")]
pub struct Arguments {
    /// Definition of the study: .toml
    definition: PathBuf,
    /// Folder for the report: index.html, results.csv, results.json
    #[arg(short, long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of timed runs of each configuration [default: the definition's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    runs: Option<u32>,
    /// Run the definition's quick form, which takes some seconds
    #[arg(long)]
    quick: bool,
    /// Print a Markdown table instead: times relative to the baseline, errors, equal bits, adapters
    #[arg(long)]
    table: bool,
    /// API (vulkan, gl, metal, dx12) or part of an adapter's name, as `epsplat adapters` lists
    /// them; twin: the kernels on the processor, without a driver, slowly
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let mut definition = Definition::read(&arguments.definition)?;
    if arguments.quick {
        definition = definition.quick_form()?;
    }
    definition.runs = arguments.runs.unwrap_or(definition.runs);
    if arguments.table && definition.baseline.is_none() {
        return Err(Error::Usage(format!(
            "--table gives times relative to a baseline, and {} names none",
            arguments.definition.display()
        )));
    }
    if let Some(folder) = &arguments.out {
        let (read, written) = (definition.files(), report::FILES.map(|name| folder.join(name)));
        let read = read.iter().map(Source::cloud).chain([Source::other(&arguments.definition)]);
        outputs::check_distinct(read, &written)?;
        let (there, missing): (Vec<_>, Vec<_>) = written.iter().partition(|file| file.exists());
        if let (Some(foreign), Some(missing)) = (there.first(), missing.first()) {
            let missing = missing.file_name().unwrap_or_default().display();
            return Err(Error::Usage(format!(
                "{} is not part of a report, as there is no {missing} beside it: name another folder for --out",
                foreign.display()
            )));
        }
        atomic::try_folder(folder)?;
        written.iter().filter(|file| file.exists()).try_for_each(|file| atomic::try_output(file))?;
    }
    let gpu = match definition.needs_gpu() {
        true => Some(Gpu::open(arguments.adapter.as_deref())?),
        false => None,
    };
    if let Some(gpu) = &gpu {
        note(&format!("rendering on {} ({}, {})", gpu.adapter.name, gpu.adapter.api, gpu.adapter.kind));
    }
    let backend = gpu.map(Backend::gpu);
    let outcome = bench::run(&definition, backend.as_ref(), &Bars::new())?;
    outcome.notes.iter().for_each(|line| note(line));
    let mut study = outcome.study;
    study.command = machine::command(std::env::args_os().map(|argument| argument.to_string_lossy().into_owned()));
    study.date = machine::date(SystemTime::now());
    let render = if arguments.table { table::markdown } else { table::text };
    print(&render(&definition, &study))?;
    if let Some(folder) = &arguments.out {
        report::write(folder, &study)?;
        note(&format!("{}: the report", folder.join("index.html").display()));
    }
    if outcome.failures.is_empty() {
        return Ok(());
    }
    Err(Error::Study { name: study.name, what: outcome.failures.join("; ") })
}
