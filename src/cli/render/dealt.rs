//! `epsplat render` with many views under mpirun or srun: each process draws whole views, the next
//! one as soon as it is done with the last. All of them read the scene.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use epsplat::low_level::network::mpi::{Deal, Mpi};
use epsplat::low_level::network::{Network, together};
use epsplat::{Error, Progress, Result};
use serde::Serialize;

use super::super::{note, write_json};
use super::output::named;
use super::ranks::{device, gathered, speaking, told};
use super::views::{Ready, Written};
use super::{Arguments, Target, views};

/// The JSON report of all processes.
#[derive(Serialize)]
struct Reports {
    /// The views in their order, each with the process that drew it.
    views: Vec<serde_json::Value>,
    /// Milliseconds from the prepared scene to the last written picture.
    total_ms: f64,
}

/// Draws the views of this process, and tells about all of them in process 0.
pub(super) fn run(arguments: &Arguments, mpi: &Mpi) -> Result<()> {
    let progress = speaking(mpi);
    let checked = Target::of_many(arguments).and_then(|target| match target.is_standard {
        true => Err(Error::Usage("several processes cannot share standard output: name a folder by -o".into())),
        false => Ok(target),
    });
    let target = together(mpi, checked)?;
    let ready = views::ready(arguments, &target, (&device(arguments), mpi.rank() == 0), &*progress);
    let ready = together(mpi, ready)?;
    let (start, all) = (Instant::now(), ready.files.len());
    let drawn = match mpi.rank() {
        0 => dealing(arguments, &target, ready, (mpi, &*progress)),
        _ => {
            let numbers = std::iter::from_fn(|| mpi.asked(all).transpose());
            views::draw(arguments, &target, ready, numbers, (&(), false))
        }
    };
    let drawn = drawn.unwrap_or_else(|source| {
        // The others would draw all of their views first.
        let error = told(mpi, &Error::Process { rank: mpi.rank(), source: Box::new(source) });
        mpi.abort(error.exit_code());
        std::process::exit(error.exit_code().into())
    });
    let numbered: Vec<_> = drawn.iter().map(|written| (written.number, written)).collect();
    let of_processes = gathered(mpi, &numbered)?;
    let written = if mpi.rank() == 0 { tell(arguments, of_processes, (all, start)) } else { Ok(()) };
    together(mpi, written)
}

/// Draws views in process 0, while it deals the others.
fn dealing(
    arguments: &Arguments,
    target: &Target,
    ready: Ready,
    (mpi, progress): (&Mpi, &dyn Progress),
) -> Result<Vec<Written>> {
    let (deal, failed) = (Deal::new(ready.files.len()), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let numbers = std::iter::from_fn(|| deal.next().map(Ok));
        let draw = || {
            let drawn = views::draw(arguments, target, ready, numbers, (progress, true));
            failed.store(drawn.is_err(), Ordering::Relaxed);
            drawn
        };
        // Only this thread may call functions of MPI.
        let drawing = scope.spawn(draw);
        let dealt = mpi.deal(&deal, || failed.load(Ordering::Relaxed));
        let drawn = drawing.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        dealt.and(drawn)
    })
}

/// Prints the summary, or writes the JSON report, of all views.
fn tell(arguments: &Arguments, of_processes: Vec<serde_json::Value>, (all, start): (usize, Instant)) -> Result<()> {
    let total_ms = start.elapsed().as_secs_f64() * 1e3;
    let Some(path) = &arguments.file.json else {
        note(&format!(
            "{}: {all} pictures by {} processes, {:.1} ms each",
            named(&arguments.output),
            of_processes.len(),
            total_ms / all.max(1) as f64
        ));
        return Ok(());
    };
    let mut views: Vec<(u64, serde_json::Value)> = Vec::with_capacity(all);
    for (rank, drawn) in of_processes.into_iter().enumerate() {
        for numbered in drawn.as_array().into_iter().flatten() {
            let mut view = numbered[1].clone();
            view["rank"] = rank.into();
            views.push((numbered[0].as_u64().unwrap_or(u64::MAX), view));
        }
    }
    views.sort_by_key(|(number, _)| *number);
    write_json(path, &Reports { views: views.into_iter().map(|(_, view)| view).collect(), total_ms })
}
