//! `epsplat render` under mpirun or srun: the processes of an MPI job draw one picture together, or
//! deal the views of a camera file or turntable among them. Process 0 speaks and writes.

use std::collections::BTreeMap;
use std::time::Instant;

use epsplat::low_level::network::mpi::{Job, Mpi};
use epsplat::low_level::network::{Network, Wire, exchanged, together};
use epsplat::options::DeviceOptions;
use epsplat::{Error, Files, Picture, Progress, Ranked, Renderer, Report, Result, Scene, View};
use serde::Serialize;

use super::super::progress::Bars;
use super::super::{note, outputs, write_json};
use super::output::{note_overflows, summary};
use super::{Arguments, Outcome, Target, dealt};

/// Draws with the processes of a job.
pub(super) fn run(arguments: &Arguments, mpi: Mpi) -> Result<()> {
    let of_views = arguments.views.cameras.is_some() || arguments.views.turntable.is_some();
    let outcome = match of_views {
        true => dealt::run(arguments, &mpi),
        false => one(arguments, &mpi),
    };
    // The processes leave together, when all know how the work ended.
    let outcome = together(&mpi, outcome);
    let told = outcome.map_err(|error| told(&mpi, &error));
    mpi.finish();
    told
}

/// Prints an error in the process that had it, before a launcher that sees another process end may
/// end this one. Returns what is left to say, which is nothing.
pub(super) fn told(network: &dyn Network, error: &Error) -> Error {
    if !matches!(error, Error::OtherProcess { .. }) {
        note(&format!("error: {error}"));
    }
    Error::OtherProcess { rank: network.rank(), code: error.exit_code() }
}

/// The options of the device for this process: the cards of a machine are dealt in turn.
pub(super) fn device(arguments: &Arguments) -> DeviceOptions {
    let job = Job::of(|name| std::env::var(name).ok());
    DeviceOptions { turn: job.map_or(0, |job| job.local_rank), ..arguments.device.clone() }
}

/// Progress and notes of process 0; the others are silent.
pub(super) fn speaking(network: &dyn Network) -> Box<dyn Progress> {
    if network.rank() == 0 { Box::new(Bars::new()) } else { Box::new(()) }
}

/// Times and counts of a process, for the JSON report.
#[derive(Serialize)]
struct OfRank {
    rank: usize,
    adapter: String,
    splats_drawn: u64,
    /// Surfels in the memory of the process.
    surfels_read: u64,
    /// Milliseconds of reading and preparing the scene.
    read_ms: f64,
    /// Milliseconds by pass.
    passes: BTreeMap<String, f64>,
    /// Milliseconds from the uploaded scene to the frame, with the exchanges.
    total_ms: f64,
    #[serde(flatten)]
    wire: Wire,
    /// The most memory that the process had, bytes; None where the system does not tell.
    peak_bytes: Option<u64>,
}

/// The JSON report of a picture.
#[derive(Serialize)]
struct OfJob<'a> {
    #[serde(flatten)]
    picture: Outcome<'a>,
    /// The name and version of the MPI library.
    mpi: &'a str,
    /// The processes, in order.
    ranks: Vec<serde_json::Value>,
}

/// Draws one picture together.
fn one(arguments: &Arguments, mpi: &Mpi) -> Result<()> {
    let progress = speaking(mpi);
    let start = Instant::now();
    let (target, view, mut renderer) = together(mpi, prepared(arguments, mpi, &*progress))?;
    let read_ms = start.elapsed().as_secs_f64() * 1e3;
    let Ranked { picture, report, wire } = renderer.frame_over(&view, mpi, &*progress)?;
    let own = OfRank {
        rank: mpi.rank(),
        splats_drawn: report.splats_drawn,
        surfels_read: renderer.surfels_read(),
        read_ms,
        passes: report.passes,
        total_ms: report.total_ms,
        adapter: report.adapter,
        wire,
        peak_bytes: peak_bytes(),
    };
    let ranks = gathered(mpi, &own)?;
    let written = picture.map_or(Ok(()), |picture| write(arguments, &target, picture, (mpi, ranks)));
    together(mpi, target.closed_is_done(written))
}

/// Checks the arguments, and reads and prepares the scene.
fn prepared(arguments: &Arguments, mpi: &Mpi, progress: &dyn Progress) -> Result<(Target, View, Renderer)> {
    if arguments.camera.pixel_size.is_some() {
        let what = "processes draw pictures together, not maps with a place on the earth: leave --pixel-size out, or run \
                    one process";
        return Err(Error::Usage(what.into()));
    }
    let target = Target::of_one(arguments)?;
    let files = Files::new(&arguments.inputs, &arguments.scene.input)?;
    let device = device(arguments);
    Renderer::check(&files, &arguments.scene, &arguments.options, &device)?;
    if mpi.rank() == 0 {
        outputs::check(arguments.files(&files), [&arguments.output].into_iter().chain(&arguments.file.json))?;
    }
    let view = View::new(&arguments.camera)?;
    let scene = Scene::of_files(files, &arguments.scene)?;
    let renderer = Renderer::of_share(&scene, &arguments.options, &device, (mpi, &view), progress)?;
    Ok((target, view, renderer))
}

/// Writes the picture of all processes, and the report.
fn write(
    arguments: &Arguments,
    target: &Target,
    picture: Picture,
    (mpi, ranks): (&Mpi, Vec<serde_json::Value>),
) -> Result<()> {
    let Picture { frame, report, view, read, unseen, .. } = picture;
    let drawn = ranks.iter().filter_map(|rank| rank["splats_drawn"].as_u64()).sum();
    let report = Report { splats_drawn: drawn, ..report };
    let adapters: std::collections::BTreeSet<&str> = ranks.iter().filter_map(|rank| rank["adapter"].as_str()).collect();
    if adapters.len() > 1 {
        let adapters: Vec<_> = adapters.into_iter().collect();
        note(&format!("several adapters drew the picture, and its bits may differ: {}", adapters.join(", ")));
    }
    note_overflows(&report);
    unseen.iter().for_each(|unseen| note(&unseen.sentence()));
    target.write(&arguments.output, &frame)?;
    match &arguments.file.json {
        Some(path) => {
            let picture = Outcome { report: &report, view, read, bits: frame.hashes() };
            write_json(path, &OfJob { picture, mpi: mpi.version(), ranks })
        }
        None => {
            note(&format!("{}; {} processes", summary(&report, &arguments.output), mpi.size()));
            Ok(())
        }
    }
}

/// Returns a value of each process in process 0, and nothing in the others.
pub(super) fn gathered(network: &dyn Network, own: &impl Serialize) -> Result<Vec<serde_json::Value>> {
    let failed = |error: serde_json::Error| Error::Usage(format!("a report cannot be sent: {error}"));
    let to_first = |bytes| {
        let mut to = vec![Vec::new(); network.size()];
        to[0] = bytes;
        to
    };
    let all = exchanged(network, serde_json::to_vec(own).map(to_first).map_err(failed))?;
    let is_first = network.rank() == 0;
    let read = all.iter().filter(|_| is_first).map(|bytes| serde_json::from_slice(bytes).map_err(failed));
    together(network, read.collect())
}

/// The most memory that this process had so far, bytes.
fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10)
}
