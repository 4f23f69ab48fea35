//! Scenes that renderers like to get wrong, the bound that each one's errors must keep, and who is known not to.
//!
//! A case is rendered by the f64 reference and, with each accumulator, on the device. Its bound is derived pixel by pixel
//! from the fragments that the reference blends there ([`bounds`]) and is that of the accumulator `fixed`; an accumulator
//! that is expected to exceed it says why, and must still keep the bound of its own row in
//! [`ACCUMULATORS`]. A verdict looks at:
//!
//! - every value of every map: none is NaN, and each differs from the reference by no more than its bound;
//! - pixels that only one of the two covers, and counts of fragments: none differ;
//! - excused pixels, where a fragment lies within [`DECISION_MARGIN`](crate::metrics::DECISION_MARGIN) of a decision, or
//!   within its own derived error of one: no more than the case allows;
//! - the RMSE of `fixed`: at most that of f32 sums and one rounding of the output, `2^-24 rms(values)`, for every map;
//! - the part of the image that the reference covers, which shows that the case is what it says.
//!
//! Images are unlit: a light multiplies the errors of two maps that are judged by themselves.

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
use crate::plan::{ACCUMULATORS, Accumulator, AccumulatorRow, RenderOptions, check};
use crate::progress::Progress;
use crate::render::{Backend, render};
use crate::scene::{Camera, Composite, Map, Maps, Samples, Scene};

/// An accumulator that is expected to exceed a case's bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Expected {
    /// Its name.
    pub accumulator: Accumulator,
    /// Why.
    pub reason: &'static str,
}

/// A scene that is hard to render, and what is demanded of its image.
#[derive(Clone, Debug)]
pub struct HardCase {
    /// A short name; orthographic twins end in `, orthographic`.
    pub name: String,
    /// What it is about, in one sentence.
    pub about: &'static str,
    /// What its bound is made of, in one sentence.
    pub bound: &'static str,
    /// The scene.
    pub scene: Scene,
    /// The camera.
    pub camera: Camera,
    /// The options, the accumulator apart.
    pub options: RenderOptions,
    /// Least and largest share of pixels that the reference covers.
    pub covered: (f64, f64),
    /// The largest share of pixels that may be excused.
    pub excused: f64,
    /// Who may exceed the bound.
    pub expected: Vec<Expected>,
    /// The smallest magnitude of an attribute, where colours span many decades: colour errors are told in units of it.
    pub smallest: Option<f64>,
}

/// The list of cases.
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

/// What a case's image should be: by the reference, and known to what error.
pub struct Truth {
    /// The f64 reference, with its map of decisions.
    pub frame: Frame,
    /// What is known at each pixel's centre.
    pub pixels: Vec<bounds::Pixel>,
    /// What is known of each sample, where a pixel has several: rows of the finer grid.
    pub samples: Vec<bounds::Pixel>,
    /// What is known of each pixel's colour, where surfaces show through each other; of the nearest one are the maps.
    pub composited: Vec<composited::Composited>,
}

impl HardCase {
    /// What is judged: points that face the camera have no normals.
    pub fn maps(&self) -> Maps {
        if self.options.facing.is_some() { Maps::ON_DEVICE.but(&[Map::Normal]) } else { Maps::ON_DEVICE }
    }

    /// Whether it can be rendered with an accumulator: surfaces that show through each other have sums of `fixed`.
    pub fn fits(&self, accumulator: &AccumulatorRow) -> bool {
        self.options.composite == Composite::Opaque || accumulator.of == Accumulator::Fixed
    }

    /// Renders the reference and derives the bounds.
    ///
    /// # Errors
    /// Those of [`render`].
    pub fn truth(&self) -> Result<Truth> {
        let options = RenderOptions { maps: self.maps().and(&[Map::Decision]), ..self.options.clone() };
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
        // As of an opaque picture, in which backs may be left out.
        Ok(Truth { frame, pixels: known(&self.camera), samples, composited })
    }

    /// Renders with `accumulator` on `backend` and judges the image.
    ///
    /// # Errors
    /// Those of [`render`].
    pub fn judge(&self, truth: &Truth, accumulator: &'static AccumulatorRow, backend: &Backend) -> Result<Row> {
        let options = RenderOptions { accumulator: accumulator.of, maps: self.maps(), ..self.options.clone() };
        let (frame, report) = render(&self.scene, &self.camera, &options, backend, &())?;
        Ok(judge(self, truth, accumulator, &frame, &report))
    }
}

/// The accumulators that the adapter of `backend` has; all of them for the reference, which ignores the choice.
pub fn supported(backend: &Backend) -> Vec<&'static AccumulatorRow> {
    let fits = |row: &&AccumulatorRow| match backend {
        Backend::Gpu { gpu, .. } => check::sums(&gpu.adapter, row.of).is_ok(),
        Backend::Reference => true,
    };
    ACCUMULATORS.iter().filter(fits).collect()
}

/// Renders and judges `cases` with `accumulators`: one row for each pair, case by case.
///
/// # Errors
/// Those of [`render`], with the case's name.
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
        compare_rmse(rows.get_mut(first..).unwrap_or_default());
    }
    progress.end();
    Ok(rows)
}

/// The rows of a run and how many ended how.
#[derive(Debug, Serialize)]
pub struct Outcome<'a> {
    /// The adapter's name.
    pub adapter: &'a str,
    /// Rows that keep all that their cases demand.
    pub passed: usize,
    /// Rows that exceed a bound as expected of their accumulator.
    pub expected_failures: usize,
    /// All others.
    pub failed: usize,
    /// All.
    pub rows: &'a [Row],
}

impl<'a> Outcome<'a> {
    /// Counts `rows`.
    pub fn of(adapter: &'a str, rows: &'a [Row]) -> Self {
        let failed = rows.iter().filter(|row| row.failed()).count();
        let expected_failures = rows.iter().filter(|row| matches!(row.verdict, Verdict::ExpectedFailure(_))).count();
        Self { adapter, passed: rows.len() - failed - expected_failures, expected_failures, failed, rows }
    }
}
