//! Writes the results of a benchmark study: a table for programs (`results.csv`), the same as JSON
//! (`results.json`), and a page for people (`index.html`) that needs no network and no script.
//!
//! The page shows, in this order: which configuration to use, what each speed costs in error
//! ([`pareto`]), all numbers, how time grows ([`scaling`]), and where in the image the errors are
//! ([`heatmap`]).

mod case;
mod choice;
mod csv;
mod family;
pub mod heatmap;
mod html;
mod labels;
pub mod pareto;
mod picture;
mod plot;
mod results;
pub mod scaling;
mod tables;
mod text;

use std::path::Path;

pub use self::results::{ImageSet, Machine, Measurement, Numeric, Study, Summary};
use crate::io::atomic::write_together;
use crate::{Error, Result};

/// The files that [`write()`] writes.
pub const FILES: [&str; 3] = ["results.csv", "results.json", "index.html"];

/// Writes [`FILES`] into the folder `dir`, which is created if it is missing. Each file appears
/// whole or not at all, and none before all are finished.
///
/// # Errors
///
/// [`Error::Write`] if a file or the folder cannot be written, [`Error::Usage`] if an image and its
/// reference differ in size.
pub fn write(dir: &Path, study: &Study) -> Result<()> {
    let page = html::page(study)?;
    let mut json = serde_json::to_string_pretty(&study.measurements).map_err(|e| Error::write(dir, e.into()))?;
    json.push('\n');
    std::fs::create_dir_all(dir).map_err(|e| Error::write(dir, e))?;
    let texts = [csv::table(&study.measurements, &study.machine), json, page];
    write_together(FILES.iter().zip(&texts).map(|(name, text)| (dir.join(name), text.as_bytes())))
}
