//! `epsplat card`: measures accuracy, equal bits and speed of an adapter in limited time.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use clap::Args;
use epsplat::io::atomic;
use epsplat::low_level::bench::card::{self, Asked, BuiltIn, Told};
use epsplat::low_level::bench::{Definition, machine};
use epsplat::low_level::report;
use epsplat::{Error, Result};

use super::outputs::Source;
use super::progress::Bars;
use super::{note, outputs, print};

/// Make a record of an adapter in limited time: accuracy, equal bits, speed.
///
/// The record has, in this order: the adapter; its bandwidth of copies by a kernel and by the copy
/// command; the hard cases; images that must have the same bits; frames of spheres that the caller
/// waits for and frames in flight, with a lower bound of the bytes per second that each pass moves;
/// order, culling and organisation beside the default; and studies. The card's clocks are read
/// before and after each step. Each step is written as soon as it is done, and steps that were left
/// out for lack of time are named. STUDIES are TOML files, as for `epsplat bench`; by default card
/// runs accumulators, organisation, optimisations, scaling and compute-vs-raster in the folder
/// benches.
#[derive(Args)]
#[command(after_help = "Examples:\n  epsplat card --out card\n  epsplat card --quick --out card-tried\n  \
    epsplat card --study hot-path --out hot-path\n\n\
    Writes card.md (a summary), card.json (all of it), hardcases.json, and a report of each study.\n\
    Exits with 1, after everything is written, if an image misses its bound or differs in a bit,\n\
    a study fails, or a step could not be done.")]
pub struct Arguments {
    /// Definitions of studies: .toml [default: those in the folder benches]
    studies: Vec<PathBuf>,
    /// Run a built-in study instead of a record: hot-path (each optimisation, organisation, fetch
    /// of tiles, threshold and number of frames in flight alone against the default, with equal
    /// bits; the configurations of STUDIES are tried in the same way)
    #[arg(long, value_name = "NAME")]
    study: Option<BuiltIn>,
    /// Folder for the records
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Try every step in less than a minute, before a long run
    #[arg(long)]
    quick: bool,
    /// Time limit in minutes; a frame or scene that has started is finished
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    minutes: u32,
    /// API (vulkan, gl, metal, dx12) or part of an adapter's name, as `epsplat adapters` lists
    /// them; twin: the kernels on the processor, without a driver, slowly
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
}

/// Folder of the studies that are run by default.
const FOLDER: &str = "benches";
/// Names of the studies that are run by default, the short ones first.
const STUDIES: [&str; 5] = ["accumulators", "organisation", "optimisations", "scaling", "compute-vs-raster"];

pub fn run(arguments: &Arguments) -> Result<()> {
    let files = match arguments.study {
        Some(_) => arguments.studies.clone(),
        None => definitions(&arguments.studies)?,
    };
    let mut studies = files.iter().map(|file| Definition::read(file)).collect::<Result<Vec<_>>>()?;
    card::check_names(&studies)?;
    let reported = if arguments.study.is_some() { &[][..] } else { &studies[..] };
    check_outputs(&arguments.out, (&files, &studies), reported)?;
    if arguments.quick && arguments.study.is_none() {
        studies = studies.into_iter().map(Definition::quick_form).collect::<Result<_>>()?;
    }
    let asked = Asked {
        adapter: arguments.adapter.clone(),
        quick: arguments.quick,
        minutes: arguments.minutes.into(),
        study: arguments.study,
        studies,
        command: machine::command(std::env::args_os().map(|argument| argument.to_string_lossy().into_owned())),
        date: machine::date(SystemTime::now()),
    };
    let record = card::run(&asked, &arguments.out, Told { progress: &Bars::new(), say: &note })?;
    print(&card::markdown(&record))?;
    note(&format!("{}: the summary", arguments.out.join(card::FILES[1]).display()));
    let failures = record.failures();
    match failures.first() {
        None => Ok(()),
        Some(first) => {
            let others = if failures.len() > 1 { format!(", and {} more", failures.len() - 1) } else { String::new() };
            Err(Error::Gpu { adapter: record.adapter.name.clone(), what: format!("{first}{others}") })
        }
    }
}

/// Returns the named definitions, or those of [`STUDIES`] if none is named.
fn definitions(named: &[PathBuf]) -> Result<Vec<PathBuf>> {
    if !named.is_empty() {
        return Ok(named.to_vec());
    }
    if !Path::new(FOLDER).is_dir() {
        return Err(Error::Usage(format!(
            "there is no folder {FOLDER} here with the default studies: name studies, or run this where the folder is"
        )));
    }
    Ok(STUDIES.iter().map(|name| Path::new(FOLDER).join(name).with_extension("toml")).collect())
}

/// Fails if the records, and a report of each study in `reported`, cannot be written to the folder,
/// or would overwrite a file that is read.
fn check_outputs(out: &Path, (files, studies): (&[PathBuf], &[Definition]), reported: &[Definition]) -> Result<()> {
    let folders: Vec<PathBuf> = reported.iter().map(|study| out.join(&study.name)).collect();
    let reports = folders.iter().flat_map(|folder| report::FILES.map(|name| folder.join(name)));
    let written: Vec<PathBuf> = card::FILES.iter().map(|name| out.join(name)).chain(reports).collect();
    let named: Vec<PathBuf> = studies.iter().flat_map(Definition::files).collect();
    let read = named.iter().map(Source::cloud).chain(files.iter().map(Source::other));
    outputs::check_distinct(read, &written)?;
    atomic::try_folder(out)?;
    folders.iter().try_for_each(|folder| atomic::try_folder(folder))?;
    written.iter().filter(|file| file.exists()).try_for_each(|file| atomic::try_output(file))
}
