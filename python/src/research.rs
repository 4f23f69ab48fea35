//! Research: errors of pictures, and studies of speed beside error.

use std::path::PathBuf;
use std::time::SystemTime;

use epsplat::low_level::bench::{self, Definition, machine};
use epsplat::low_level::gpu::Gpu;
use epsplat::low_level::metrics::compare as compared;
use epsplat::low_level::render::Backend;
use epsplat::low_level::report;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{exception, usage};
use crate::images::frame;
use crate::task::run;

/// Measures the error of one picture against another. Returns the measures as JSON.
#[pyfunction]
pub fn compare(
    py: Python<'_>,
    color: &Bound<'_, PyAny>,
    maps: &Bound<'_, PyDict>,
    exact: &Bound<'_, PyAny>,
    exact_maps: &Bound<'_, PyDict>,
) -> PyResult<String> {
    let (a, b) = (frame(color, Some(maps))?, frame(exact, Some(exact_maps))?);
    let comparison = py.detach(|| compared(&a, &b)).map_err(|error| exception(py, &error))?;
    Ok(serde_json::to_string(&comparison).unwrap_or_default())
}

/// Runs a study. Returns its measurements and machine as JSON, with its notes and failures.
#[pyfunction]
#[pyo3(signature = (path, quick, runs, adapter, out, progress))]
pub fn study(
    py: Python<'_>,
    path: PathBuf,
    quick: bool,
    runs: Option<u32>,
    adapter: Option<String>,
    out: Option<PathBuf>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(String, String, Vec<String>, Vec<String>)> {
    if runs.is_some_and(|runs| !(1..=10_000).contains(&runs)) {
        return Err(usage(py, "runs lie between 1 and 10000"));
    }
    let ((study, failures), notes) = run(py, progress, |progress| {
        let mut definition = Definition::read(&path)?;
        if quick {
            definition = definition.quick_form()?;
        }
        definition.runs = runs.unwrap_or(definition.runs);
        let gpu = definition.needs_gpu().then(|| Gpu::open(adapter.as_deref())).transpose()?;
        let outcome = bench::run(&definition, gpu.map(Backend::gpu).as_ref(), progress)?;
        outcome.notes.iter().for_each(|line| progress.note(line));
        let mut study = outcome.study;
        study.command = format!("epsplat.study({:?})", path.display().to_string());
        study.date = machine::date(SystemTime::now());
        if let Some(folder) = &out {
            report::write(folder, &study)?;
        }
        Ok((study, outcome.failures))
    })?;
    let rows = serde_json::to_string(&study.measurements).unwrap_or_default();
    Ok((rows, serde_json::to_string(&study.machine).unwrap_or_default(), notes, failures))
}
