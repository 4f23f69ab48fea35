//! Tests accuracy, determinism, speed and copy bandwidth of one adapter within a time limit.
//!
//! [`run`] performs the steps in an order in which each step helps to interpret the next. It writes
//! [`FILES`] after each step, so that an interrupted run keeps its results. If a step fails, the
//! error is added to the [`Record`] and the next step opens the adapter again. The card's clocks
//! are read before and after each step.

mod accuracy;
mod bytes;
mod changes;
mod clocks;
mod determinism;
mod hot_path;
mod markdown;
mod pace;
mod record;
mod speeds;
mod studies;
mod throughput;

use std::path::Path;
use std::str::FromStr;
use std::time::{Duration, Instant};

pub use self::accuracy::{Accuracy, Worst};
pub use self::bytes::Moved;
pub use self::clocks::Clocks;
pub use self::determinism::Comparison;
pub use self::hot_path::Trial;
pub use self::markdown::markdown;
pub use self::pace::{InFlight, WarmUp};
pub use self::record::{FILES, Record, Step};
pub use self::studies::{ConfigRecord, StudyRecord, check_names};
pub use self::throughput::{PassRecord, Throughput};

use super::bandwidth::{Copier, CopyBandwidth};
use super::definition::Definition;
use super::staging::{Point, Staged, stage};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::progress::Progress;
use crate::render::Backend;

/// The arguments of a run.
#[derive(Clone, Debug)]
pub struct Asked {
    /// The name of the adapter, as for [`Gpu::open`].
    pub adapter: Option<String>,
    /// Whether to run the short form, which tries everything in less than a minute.
    pub quick: bool,
    /// Time limit in minutes. Work that does not fit is skipped and listed in [`Record::left_out`].
    pub minutes: f64,
    /// A built-in study that is run alone, in place of a record.
    pub study: Option<BuiltIn>,
    /// The studies. For a quick run, the caller passes their quick forms. With a built-in study,
    /// their configurations are tried beside its own.
    pub studies: Vec<Definition>,
    /// The command line, as it is recorded.
    pub command: String,
    /// The date, as it is recorded.
    pub date: String,
}

/// A study that needs no file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BuiltIn {
    /// Each change of the hot path alone against the default.
    HotPath,
}

impl FromStr for BuiltIn {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "hot-path" => Ok(Self::HotPath),
            _ => Err(Error::Usage(format!("there is no built-in study {text:?}: take hot-path"))),
        }
    }
}

/// The callbacks that report the progress of a run.
#[derive(Clone, Copy)]
pub struct Told<'a> {
    /// Receives the progress within a step, in units of work.
    pub progress: &'a dyn Progress,
    /// Receives lines of text about each step.
    pub say: &'a dyn Fn(&str),
}

/// A step: its name, and its function.
type Work = (&'static str, fn(&mut Card<'_>) -> Result<()>);

/// The steps of a record after the first, which opens the adapter.
const STEPS: [Work; 6] = [
    ("copy bandwidth", bandwidth),
    ("accuracy", accuracy::check),
    ("determinism", determinism::check),
    ("throughput", throughput::measure),
    ("choices", hot_path::usual),
    ("studies", studies::run),
];

/// The steps of the study of the hot path, after the first.
const HOT_PATH: [Work; 2] = [("copy bandwidth", bandwidth), ("hot path", hot_path::study)];

/// Buffer sizes in bytes of the copy bandwidth, the smallest first: full run, quick run. A buffer
/// that fits a card's cache is copied faster than memory.
const COPIED: [&[u64]; 2] = [&[16 << 20, 64 << 20, 256 << 20, 1 << 30], &[4 << 20, 32 << 20]];

/// Number of timings of the copy bandwidth: full run, quick run.
const COPY_RUNS: [u32; 2] = [9, 3];

/// Runs all steps and writes their records into `folder`, which is created if it is missing.
///
/// # Errors
///
/// [`Error::NoAdapter`] if the adapter does not exist or cannot be opened again, and
/// [`Error::Write`] if a file cannot be written. All other errors are in the record
/// ([`Record::failures`]).
pub fn run(asked: &Asked, folder: &Path, told: Told<'_>) -> Result<Record> {
    let start = Instant::now();
    std::fs::create_dir_all(folder).map_err(|e| Error::write(folder, e))?;
    let work: &[Work] = if asked.study.is_some() { &HOT_PATH } else { &STEPS };
    let steps = 1 + work.len();
    (told.say)(&format!("[1/{steps}] adapter"));
    let gpu = Gpu::open(asked.adapter.as_deref())?;
    let adapter = gpu.adapter.clone();
    (told.say)(&format!("{} ({}, {}), {}", adapter.name, adapter.api, adapter.kind, adapter.driver));
    let backend = Backend::gpu(gpu);
    let budget = Budget { start, total: Duration::from_secs_f64(60.0 * asked.minutes) };
    let record = Record::new(asked, &backend, adapter);
    let mut card = Card { asked, folder, told, budget, backend, record };
    card.end_step("adapter", start)?;
    for (number, step) in (2..).zip(work) {
        card.step(&format!("[{number}/{steps}]"), *step)?;
    }
    Ok(card.record)
}

/// The state of a run.
struct Card<'a> {
    asked: &'a Asked,
    folder: &'a Path,
    told: Told<'a>,
    budget: Budget,
    backend: Backend,
    record: Record,
}

impl Card<'_> {
    fn step(&mut self, number: &str, (name, work): Work) -> Result<()> {
        let start = Instant::now();
        let [spent, total] = [self.budget.start.elapsed(), self.budget.total].map(|time| time.as_secs());
        (self.told.say)(&format!("{number} {name} (after {spent} of {total} s)"));
        self.read_clocks(format!("before {name}"));
        if let Err(error) = work(self) {
            self.problem(name, error)?;
        }
        self.read_clocks(format!("after {name}"));
        self.end_step(name, start)
    }

    /// Records the error and opens the adapter again, as the device may be lost.
    ///
    /// A write error ends the run.
    fn problem(&mut self, what: &str, error: Error) -> Result<()> {
        self.told.progress.end();
        if let Error::Write { .. } = error {
            return Err(error);
        }
        let sentence = format!("{what}: {error}");
        (self.told.say)(&format!("  {sentence}"));
        self.record.problems.push(sentence);
        self.write()?;
        self.backend = Backend::gpu(Gpu::open(self.asked.adapter.as_deref())?);
        Ok(())
    }

    fn end_step(&mut self, name: &'static str, start: Instant) -> Result<()> {
        self.record.steps.push(Step { name, seconds: start.elapsed().as_secs_f64() });
        self.write()
    }

    fn write(&mut self) -> Result<()> {
        self.record.seconds = self.budget.start.elapsed().as_secs_f64();
        self.record.write(self.folder)
    }

    /// The place of this run's form in constants: 0 for a full run, 1 for a quick run.
    fn form(&self) -> usize {
        usize::from(self.asked.quick)
    }

    /// Records the card's clocks at this time.
    fn read_clocks(&mut self, when: String) {
        self.record.clocks.push(Clocks::read(&self.record.adapter, when));
    }

    /// Records work that is skipped, with the reason, and reports it.
    fn leave_out(&mut self, what: String) {
        (self.told.say)(&format!("  left out: {what}"));
        self.record.left_out.push(what);
    }
}

/// Measures copies by kernels and by commands. Sizes that the adapter does not allow are left out.
fn bandwidth(card: &mut Card<'_>) -> Result<()> {
    let form = card.form();
    let Backend::Gpu { gpu, .. } = &card.backend else { return Ok(()) };
    let mut sizes: Vec<u64> = COPIED[form].iter().map(|bytes| (*bytes).min(gpu.buffer_limit())).collect();
    sizes.dedup();
    let mut unable = Vec::new();
    for by in [Copier::Kernel, Copier::Command] {
        for bytes in &sizes {
            match CopyBandwidth::measure(gpu, by, *bytes, COPY_RUNS[form]) {
                Ok(found) => card.record.copies.push(found),
                // The last size that fits stands for memory.
                Err(error) if card.record.copy_of_memory(by).is_some() => {
                    unable.push(format!("copies of {bytes} bytes: {error}"));
                    break;
                }
                Err(error) => return Err(error),
            }
        }
    }
    unable.into_iter().for_each(|what| card.leave_out(what));
    let speed = |copy: Option<&CopyBandwidth>| copy.map_or(0.0, |copy| copy.gb_per_second.max);
    let [kernel, command] = [Copier::Kernel, Copier::Command].map(|by| speed(card.record.copy_of_memory(by)));
    (card.told.say)(&format!("  {kernel:.1} GB/s by a kernel, {command:.1} GB/s by the copy command"));
    Ok(())
}

/// The time limit of a run.
struct Budget {
    start: Instant,
    total: Duration,
}

impl Budget {
    fn left(&self) -> Duration {
        self.total.saturating_sub(self.start.elapsed())
    }

    /// Returns the time at which the fraction `part` of the remaining time is over.
    fn share(&self, part: f64) -> Instant {
        Instant::now() + self.left().mul_f64(part)
    }
}

/// Prepares a sphere of `count` surfels in an image of `side` x `side` pixels.
///
/// `footprint_px` is the mean splat radius in pixels; without it, the radius is 1.5 spacings.
fn sphere(count: u64, footprint_px: Option<f64>, side: u32, progress: &dyn Progress) -> Result<Staged> {
    let text = format!(
        "name = \"card\"\nabout = \"A sphere.\"\nsize = [{side}, {side}]\n\
         [[scene]]\nname = \"sphere\"\nshape = \"sphere\"\ncount = 1\n[[config]]\nname = \"default\"\nbackend = \"gpu\"\n"
    );
    let definition = Definition::parse(&text, Path::new("card"))?;
    let Some(entry) = definition.scenes.first() else { return Err(Error::EmptyScene("there is no sphere".into())) };
    stage(&definition, entry, Point { count: Some(count), footprint_px }, progress)
}
