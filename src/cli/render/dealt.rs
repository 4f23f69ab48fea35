//! `epsplat render` with many views under mpirun or srun: each process draws whole views, every
//! n-th one. All of them read the scene.

use std::time::Instant;

use epsplat::low_level::network::mpi::Mpi;
use epsplat::low_level::network::{Network, together};
use epsplat::{Error, Result};
use serde::Serialize;

use super::super::{note, write_json};
use super::output::named;
use super::ranks::{device, gathered, speaking, told};
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
    let drawn = views::draw(arguments, &target, ready.dealt(mpi.rank(), mpi.size()), (&*progress, mpi.rank() == 0));
    let drawn = drawn.unwrap_or_else(|source| {
        // The others would draw all of their views first.
        let error = told(mpi, &Error::Process { rank: mpi.rank(), source: Box::new(source) });
        mpi.abort(error.exit_code());
        std::process::exit(error.exit_code().into())
    });
    let of_processes = gathered(mpi, &drawn)?;
    let written = if mpi.rank() == 0 { tell(arguments, &of_processes, (all, start)) } else { Ok(()) };
    together(mpi, written)
}

/// Prints the summary, or writes the JSON report, of all views.
fn tell(arguments: &Arguments, of_processes: &[serde_json::Value], (all, start): (usize, Instant)) -> Result<()> {
    let total_ms = start.elapsed().as_secs_f64() * 1e3;
    let size = of_processes.len();
    let Some(path) = &arguments.file.json else {
        note(&format!(
            "{}: {all} pictures by {size} processes, {:.1} ms each",
            named(&arguments.output),
            total_ms / all.max(1) as f64
        ));
        return Ok(());
    };
    let view = |index: usize| {
        let mut view = of_processes[index % size][index / size].clone();
        view["rank"] = (index % size).into();
        view
    };
    write_json(path, &Reports { views: (0..all).map(view).collect(), total_ms })
}
