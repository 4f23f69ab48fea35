//! Tests accuracy, determinism, speed and copy bandwidth of one adapter within a time limit.
//!
//! [`run`] performs the steps in an order in which each step helps to interpret the next. It writes
//! [`FILES`] after each step, so that an interrupted run keeps its results. If a step fails, the
//! error is added to the [`Record`] and the next step opens the adapter again.

mod accuracy;
mod bytes;
mod determinism;
mod markdown;
mod record;
mod studies;
mod throughput;

use std::path::Path;
use std::time::{Duration, Instant};

pub use self::accuracy::{Accuracy, Worst};
pub use self::bytes::Moved;
pub use self::determinism::Comparison;
pub use self::markdown::markdown;
pub use self::record::{FILES, Record, Step};
pub use self::studies::{ConfigRecord, StudyRecord, check_names};
pub use self::throughput::{PassRecord, Throughput};

use super::bandwidth::CopyBandwidth;
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
    /// The studies. For a quick run, the caller passes their quick forms.
    pub studies: Vec<Definition>,
    /// The command line, as it is recorded.
    pub command: String,
    /// The date, as it is recorded.
    pub date: String,
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

/// The steps after the first, which opens the adapter.
const STEPS: [Work; 5] = [
    ("copy bandwidth", bandwidth),
    ("accuracy", accuracy::check),
    ("determinism", determinism::check),
    ("throughput", throughput::measure),
    ("studies", studies::run),
];

/// Buffer size in bytes and number of timings of the copy bandwidth, in a full and in a quick run.
const COPIED: [(u64, u32); 2] = [(256 << 20, 9), (32 << 20, 5)];

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
    let steps = 1 + STEPS.len();
    (told.say)(&format!("[1/{steps}] adapter"));
    let gpu = Gpu::open(asked.adapter.as_deref())?;
    let adapter = gpu.adapter.clone();
    (told.say)(&format!("{} ({}, {}), {}", adapter.name, adapter.api, adapter.kind, adapter.driver));
    let backend = Backend::gpu(gpu);
    let budget = Budget { start, total: Duration::from_secs_f64(60.0 * asked.minutes) };
    let record = Record::new(asked, &backend, adapter);
    let mut card = Card { asked, folder, told, budget, backend, record };
    card.end_step("adapter", start)?;
    for (number, step) in (2..).zip(STEPS) {
        card.step(&format!("[{number}/{steps}]"), step)?;
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
        if let Err(error) = work(self) {
            self.problem(name, error)?;
        }
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

    /// Records work that is skipped, with the reason, and reports it.
    fn leave_out(&mut self, what: String) {
        (self.told.say)(&format!("  left out: {what}"));
        self.record.left_out.push(what);
    }
}

fn bandwidth(card: &mut Card<'_>) -> Result<()> {
    let (bytes, runs) = COPIED[usize::from(card.asked.quick)];
    if let Backend::Gpu { gpu, .. } = &card.backend {
        let found = CopyBandwidth::measure(gpu, bytes, runs)?;
        (card.told.say)(&format!("  {:.1} GB/s", found.gb_per_second.median));
        card.record.copy_bandwidth = Some(found);
    }
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
