//! `epsplat card`: all that shows what an adapter does, in one run of limited time.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use clap::Args;
use epsplat::bench::card::{self, Asked, Told};
use epsplat::bench::{Definition, machine};
use epsplat::io::atomic;
use epsplat::{Error, Result, report};

use super::outputs::Source;
use super::progress::Bars;
use super::{note, outputs, print};

/// Make a record of an adapter in limited time: accuracy, equal bits, speed.
///
/// The record holds, in this order: the adapter; its copy bandwidth; the hard cases; images that
/// must have the same bits; frames of spheres, with the bytes per second that each pass moves at
/// least; and studies. Each step is written as soon as it is done, and steps for which there was no
/// time are named. STUDIES are TOML files, as for `epsplat bench`; without any, card runs those of
/// accumulators, organisation, optimisations, scaling and compute-vs-raster in the folder benches.
#[derive(Args)]
#[command(after_help = "Examples:\n  epsplat card --out card\n  epsplat card --quick --out card-tried\n\n\
    Writes card.md (a summary), card.json (all of it), hardcases.json, and a report of each study.\n\
    Exits with 1, after everything is written, if an image misses its bound or differs in a bit,\n\
    a study fails, or a step could not be done.")]
pub struct Arguments {
    /// Definitions of studies: .toml
    studies: Vec<PathBuf>,
    /// A folder for the records
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// A form of less than a minute, which tries everything before a long run
    #[arg(long)]
    quick: bool,
    /// Minutes that it may take, about: the last frame or scene that fits is ended
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    minutes: u32,
    /// An API (vulkan, gl, metal, dx12) or part of an adapter's name, as `epsplat adapters` lists them
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
}

/// The folder of the studies that are run if none is named, and these: the short ones first.
const FOLDER: &str = "benches";
const STUDIES: [&str; 5] = ["accumulators", "organisation", "optimisations", "scaling", "compute-vs-raster"];

pub fn run(arguments: &Arguments) -> Result<()> {
    let files = definitions(&arguments.studies)?;
    let mut studies = files.iter().map(|file| Definition::read(file)).collect::<Result<Vec<_>>>()?;
    card::check_names(&studies)?;
    check_outputs(&arguments.out, &files, &studies)?;
    if arguments.quick {
        studies = studies.into_iter().map(Definition::quick_form).collect();
    }
    let asked = Asked {
        adapter: arguments.adapter.clone(),
        quick: arguments.quick,
        minutes: arguments.minutes.into(),
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

/// The definitions that are named, or those of [`STUDIES`].
fn definitions(named: &[PathBuf]) -> Result<Vec<PathBuf>> {
    if !named.is_empty() {
        return Ok(named.to_vec());
    }
    if !Path::new(FOLDER).is_dir() {
        return Err(Error::Usage(format!(
            "there is no folder {FOLDER} here, whose studies are run if none is named: name some, or run this where the folder is"
        )));
    }
    Ok(STUDIES.iter().map(|name| Path::new(FOLDER).join(name).with_extension("toml")).collect())
}

/// Refuses a folder in which the records cannot be written, or would overwrite what is read.
fn check_outputs(out: &Path, files: &[PathBuf], studies: &[Definition]) -> Result<()> {
    let folders: Vec<PathBuf> = studies.iter().map(|study| out.join(&study.name)).collect();
    let reports = folders.iter().flat_map(|folder| report::FILES.map(|name| folder.join(name)));
    let written: Vec<PathBuf> = card::FILES.iter().map(|name| out.join(name)).chain(reports).collect();
    let named: Vec<PathBuf> = studies.iter().flat_map(Definition::files).collect();
    let read = named.iter().map(Source::cloud).chain(files.iter().map(Source::other));
    outputs::check_distinct(read, &written)?;
    atomic::try_folder(out)?;
    folders.iter().try_for_each(|folder| atomic::try_folder(folder))?;
    written.iter().filter(|file| file.exists()).try_for_each(|file| atomic::try_output(file))
}
