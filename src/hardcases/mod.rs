//! Scenes that are hard to render correctly, with a bound on the error of each image.
//!
//! A case is rendered by the f64 reference and, with each accumulator, on the device. Its bound is
//! derived pixel by pixel from the fragments that the reference blends there ([`bounds`]), for the
//! accumulator `fixed`. An accumulator that is expected to exceed this bound has a stated reason,
//! and must still keep the bound of its own row in [`ACCUMULATORS`]. A verdict checks:
//!
//! - every value of every map: none is NaN, and each differs from the reference by no more than its
//!   bound;
//! - coverage and count of fragments of every pixel: they are the same in the image and the
//!   reference;
//! - excused pixels, where a fragment lies within
//!   [`DECISION_MARGIN`](crate::metrics::DECISION_MARGIN) of a decision, or within its own derived
//!   error of one: no more than the case allows;
//! - the RMSE of `fixed`: at most that of f32 sums plus one rounding of the output,
//!   `2^-24 rms(values)`, for every map;
//! - the part of the image that the reference covers, which shows that the scene is as intended.
//!
//! Images are unlit, because a light multiplies the errors of two maps that are judged separately.

pub mod bounds;
mod cases;
pub mod composited;
mod curved;
mod ends;
mod extremes;
mod fragment_bounds;
mod judge;
mod points;
pub mod precision;
mod staging;
mod through;

use serde::Serialize;

pub use judge::{MapError, Row, Verdict, compare_rmse, judge};

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::plan::{ACCUMULATORS, Accumulator, AccumulatorRow, Settings, check};
use crate::progress::Progress;
use crate::render::{Backend, render};
use crate::scene::{Camera, Composite, Map, Maps, Samples, Scene};

/// In an image of fewer pixels, chance decides which of two sums has the smaller RMSE.
const FEWEST_PIXELS: usize = 16;

/// An accumulator that is expected to exceed a case's bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Expected {
    /// The accumulator.
    pub accumulator: Accumulator,
    /// The reason, for reports.
    pub reason: &'static str,
}

/// A scene that is hard to render, and the requirements on its image.
#[derive(Clone, Debug)]
pub struct HardCase {
    /// A short name; the names of orthographic twins end in `, orthographic`.
    pub name: String,
    /// The difficulty, in one sentence.
    pub about: &'static str,
    /// The parts of its bound, in one sentence.
    pub bound: &'static str,
    /// The scene.
    pub scene: Scene,
    /// The camera.
    pub camera: Camera,
    /// The options, except the accumulator.
    pub options: Settings,
    /// Least and largest fraction of pixels that the reference covers.
    pub covered: (f64, f64),
    /// Largest fraction of pixels that may be excused.
    pub excused: f64,
    /// Accumulators that may exceed the bound.
    pub expected: Vec<Expected>,
    /// Smallest magnitude of an attribute, if colours span many decades; colour errors are then
    /// also reported in units of it.
    pub smallest: Option<f64>,
}

/// Builds all cases.
///
/// # Errors
/// None that a caller could cause: the cameras are built by functions that can fail.
pub fn cases() -> Result<Vec<HardCase>> {
    let mut all = cases::cases()?;
    all.extend(ends::cases()?);
    all.extend(curved::cases()?);
    all.extend(points::cases()?);
    all.extend(through::cases()?);
    all.extend(extremes::cases()?);
    Ok(all)
}

/// The correct image of a case, and the errors that the device may make in it.
pub struct Truth {
    /// The f64 reference, with its map of decisions.
    pub frame: Frame,
    /// The error terms at each pixel's centre.
    pub pixels: Vec<bounds::Pixel>,
    /// The error terms of each sample, in rows of the finer grid, if a pixel has several samples.
    pub samples: Vec<bounds::Pixel>,
    /// The bounds on each pixel's colour, if surfaces show through each other; the maps are still
    /// those of the nearest surface.
    pub composited: Vec<composited::Composited>,
}

impl HardCase {
    /// Returns the maps to judge. Points that face the camera have no normals.
    pub fn maps(&self) -> Maps {
        if self.options.facing.is_some() { Maps::ON_DEVICE.but(&[Map::Normal]) } else { Maps::ON_DEVICE }
    }

    /// Whether the case can be rendered with an accumulator: composited surfaces use the sums of
    /// `fixed`.
    pub fn fits(&self, accumulator: &AccumulatorRow) -> bool {
        self.options.composite == Composite::Opaque || accumulator.of == Accumulator::Fixed
    }

    /// Renders the reference and derives the bounds.
    pub fn truth(&self) -> Result<Truth> {
        let options = Settings { maps: self.maps().and(&[Map::Decision]), ..self.options.clone() };
        let (frame, _) = render(&self.scene, &self.camera, &options, &Backend::Reference, &())?;
        let known = |camera: &Camera| bounds::pixels(&self.scene, camera, &self.options);
        let samples = match self.options.samples {
            Samples::ONE => Vec::new(),
            samples => known(&self.camera.sampled(samples)?),
        };
        let composited = match self.options.composite {
            Composite::Opaque => Vec::new(),
            _ => composited::pixels(&self.scene, &self.camera, &self.options),
        };
        // The terms in `pixels` are those of an opaque picture, in which backs may be left out.
        Ok(Truth { frame, pixels: known(&self.camera), samples, composited })
    }

    /// Renders with `accumulator` on `backend`, and judges the image.
    pub fn judge(&self, truth: &Truth, accumulator: &'static AccumulatorRow, backend: &Backend) -> Result<Row> {
        let options = Settings { accumulator: accumulator.of, maps: self.maps(), ..self.options.clone() };
        let (frame, report) = render(&self.scene, &self.camera, &options, backend, &())?;
        Ok(judge(self, truth, accumulator, &frame, &report))
    }
}

/// Returns the accumulators that the adapter of `backend` supports; for the reference, which
/// ignores the choice, all.
pub fn supported(backend: &Backend) -> Vec<&'static AccumulatorRow> {
    let fits = |row: &&AccumulatorRow| match backend {
        Backend::Gpu { gpu, .. } => check::sums(&gpu.adapter, row.of).is_ok(),
        Backend::Reference => true,
    };
    ACCUMULATORS.iter().filter(fits).collect()
}

/// Renders and judges `cases` with `accumulators`. Returns one row per pair, case by case.
pub fn run(
    cases: &[HardCase],
    accumulators: &[&'static AccumulatorRow],
    backend: &Backend,
    progress: &dyn Progress,
) -> Result<Vec<Row>> {
    let fits = |case: &HardCase| accumulators.iter().filter(|row| case.fits(row)).count();
    progress.begin("hard cases", cases.iter().map(fits).sum::<usize>() as u64);
    let mut rows = Vec::new();
    for case in cases {
        let truth = case.truth()?;
        let first = rows.len();
        for accumulator in accumulators.iter().filter(|row| case.fits(row)) {
            rows.push(case.judge(&truth, accumulator, backend).map_err(|error| match error {
                Error::Gpu { adapter, what } => {
                    let what = format!("the case {}, accumulator {}: {what}", case.name, accumulator.name);
                    Error::Gpu { adapter, what }
                }
                other => other,
            })?);
            progress.advance(1);
        }
        if case.camera.pixels() >= FEWEST_PIXELS {
            compare_rmse(rows.get_mut(first..).unwrap_or_default());
        }
    }
    progress.end();
    Ok(rows)
}

/// The rows of a run, and counts of their verdicts.
#[derive(Debug, Serialize)]
pub struct Outcome<'a> {
    /// Name of the adapter.
    pub adapter: &'a str,
    /// Number of rows that meet all requirements of their cases.
    pub passed: usize,
    /// Number of rows that exceed a bound as expected of their accumulator.
    pub expected_failures: usize,
    /// Number of all other rows.
    pub failed: usize,
    /// All rows.
    pub rows: &'a [Row],
}

impl<'a> Outcome<'a> {
    /// Counts the verdicts of `rows`.
    pub fn of(adapter: &'a str, rows: &'a [Row]) -> Self {
        let failed = rows.iter().filter(|row| row.failed()).count();
        let expected_failures = rows.iter().filter(|row| matches!(row.verdict, Verdict::ExpectedFailure(_))).count();
        Self { adapter, passed: rows.len() - failed - expected_failures, expected_failures, failed, rows }
    }
}
