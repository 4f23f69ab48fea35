//! The results of a study, as data.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::frame::Frame;

/// A study: what was run, where, and the results.
#[derive(Clone, Debug)]
pub struct Study {
    /// A short name, which is the page's title.
    pub name: String,
    /// One sentence that says what the study shows.
    pub about: String,
    /// The command line that repeats the study.
    pub command: String,
    /// Date of the run, formatted for readers.
    pub date: String,
    /// The machine that it ran on.
    pub machine: Machine,
    /// Number of timed runs of each configuration; each [`Summary`] is over these.
    pub runs: u32,
    /// One measurement for each configuration of each scene.
    pub measurements: Vec<Measurement>,
    /// Pictures, which appear only on the page.
    pub images: Vec<ImageSet>,
}

/// The machine and the software that a study ran on.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Machine {
    /// Name of the adapter.
    pub adapter: String,
    /// Graphics API of the adapter.
    pub api: String,
    /// Driver of the adapter, and its version.
    pub driver: String,
    /// Name of the processor.
    pub cpu: String,
    /// Logical cores that the process may use.
    pub cores: u32,
    /// Operating system.
    pub os: String,
    /// Version of epsplat.
    pub version: String,
    /// Commit of the clone in which the study ran; empty outside a clone.
    pub commit: String,
}

/// The measurement of one configuration on one scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Measurement {
    /// Name of the study.
    pub study: String,
    /// Name of the scene.
    pub scene: String,
    /// Name of the configuration, the same in every scene.
    pub config: String,
    /// `gpu` (compute kernels), `raster` (fixed-function blending) or `reference` (f64 on the
    /// processor).
    pub backend: String,
    /// Name of the accumulator; empty if the backend has no choice.
    pub accumulator: String,
    /// Number of surfels in the scene.
    pub surfels: u64,
    /// Mean radius of a splat, pixels.
    pub footprint_px: f64,
    /// Width of the image, pixels.
    pub width: u32,
    /// Height of the image, pixels.
    pub height: u32,
    /// Time of a frame, milliseconds.
    pub total_ms: Summary,
    /// Time of a frame in each run, milliseconds, in the order of the runs.
    pub runs_ms: Vec<f64>,
    /// Time of each pass by its name, milliseconds.
    pub passes: BTreeMap<String, Summary>,
    /// Surfels of the scene per second of the median time. Hidden surfels count too, whether or not
    /// a backend draws them.
    pub splats_per_second: f64,
    /// Fragments blended per second of the median time; `None` if they were not counted.
    pub fragments_per_second: Option<f64>,
    /// Bytes of device memory per splat, for its surfel and its record.
    pub bytes_per_splat: f64,
    /// Peak device memory of the render, bytes.
    pub device_bytes: u64,
    /// Error against the f64 reference with the same options; `None` if it was not compared.
    pub numeric: Option<Numeric>,
    /// Further measures, by name.
    ///
    /// Measures against ground truth are `psnr_db`, `max_abs`, `percentile_99_9`, `ssim`,
    /// `depth_relative_mean`, `normal_degrees_mean`, `hole_rate` and so on; without ground truth
    /// there are none. `apart_psnr_db` and `apart_rmse` are against the reference of the
    /// configuration that this one approximates, and `cut` is the number of surfels that are drawn
    /// in place of all. An image that equals the truth has an infinite `psnr_db`.
    pub reconstruction: BTreeMap<String, f64>,
    /// Speed relative to the fastest raster configuration of the same scene with an equal or
    /// smaller [`numeric_error`](Self::numeric_error); `None` if there is no such configuration.
    pub ratio_to_raster: Option<f64>,
    /// Largest [`numeric_error`](Self::numeric_error) that the study allows; `None` if it allows
    /// any.
    pub error_limit: Option<f64>,
    /// Whether the error limit is kept; true if there is none.
    pub kept: bool,
}

impl Measurement {
    /// The error that the report ranks by: [`Numeric::rmse`]; `None` if it is missing or not
    /// finite.
    pub fn numeric_error(&self) -> Option<f64> {
        self.numeric.as_ref().map(|numeric| numeric.rmse).filter(|rmse| rmse.is_finite() && *rmse >= 0.0)
    }

    /// RMSE against ground truth, from the PSNR for a peak of 1: `10^(-PSNR / 20)`; `None` without
    /// ground truth.
    pub fn reconstruction_error(&self) -> Option<f64> {
        let psnr = self.reconstruction.get("psnr_db")?;
        Some(10f64.powf(-psnr / 20.0)).filter(|rmse| rmse.is_finite())
    }

    /// Number of pixels of the image.
    pub fn pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }
}

/// Statistics of repeated measurements, in the unit of the values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Summary {
    /// The middle value, or the mean of the middle two.
    pub median: f64,
    /// Median absolute deviation from the median, unscaled.
    pub mad: f64,
    /// The smallest value.
    pub min: f64,
    /// The largest value.
    pub max: f64,
}

impl Summary {
    /// Summarises finite values; `None` if there are no values.
    ///
    /// ```
    /// use epsplat::low_level::report::Summary;
    /// let summary = Summary::of(&[4.0, 1.0, 2.0, 100.0]);
    /// assert_eq!(summary, Some(Summary { median: 3.0, mad: 1.5, min: 1.0, max: 100.0 }));
    /// ```
    pub fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let (min, max) = (*sorted.first()?, *sorted.last()?);
        let median = middle(&sorted);
        let mut deviations: Vec<f64> = sorted.iter().map(|value| (value - median).abs()).collect();
        deviations.sort_by(f64::total_cmp);
        Some(Self { median, mad: middle(&deviations), min, max })
    }
}

/// Median of sorted values; there must be at least one.
fn middle(sorted: &[f64]) -> f64 {
    let half = sorted.len() / 2;
    if sorted.len().is_multiple_of(2) { sorted[half - 1] / 2.0 + sorted[half] / 2.0 } else { sorted[half] }
}

/// The error of an image against the f64 reference, over linear RGBA.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Numeric {
    /// Root of the mean squared difference of all values.
    pub rmse: f64,
    /// Largest absolute difference of a value.
    pub max_abs: f64,
    /// Peak signal-to-noise ratio for a peak of 1, dB; `None` if the images are equal.
    pub psnr_db: Option<f64>,
}

/// The picture of one configuration on one scene.
#[derive(Clone, Debug)]
pub struct ImageSet {
    /// [`Measurement::scene`].
    pub scene: String,
    /// [`Measurement::config`].
    pub config: String,
    /// The image that the configuration rendered.
    pub image: Frame,
    /// The f64 reference's image with the same options, of the same size; `None` if there is none.
    pub reference: Option<Frame>,
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    #[test]
    fn a_summary_is_the_median_and_what_deviates_from_it() {
        assert_eq!(Summary::of(&[]), None);
        assert_eq!(Summary::of(&[7.0]), Some(Summary { median: 7.0, mad: 0.0, min: 7.0, max: 7.0 }));
        let odd = Summary::of(&[3.0, 1.0, 9.0, 2.0, 4.0]).unwrap();
        assert_eq!(odd, Summary { median: 3.0, mad: 1.0, min: 1.0, max: 9.0 });
        let even = Summary::of(&[1.0, 2.0]).unwrap();
        assert_eq!((even.median, even.mad), (1.5, 0.5));
        // The mean of two large values does not overflow, and NaN does not panic.
        assert_eq!(Summary::of(&[f64::MAX, f64::MAX]).unwrap().median, f64::MAX);
        assert_eq!(Summary::of(&[f64::NAN, 1.0, 2.0]).unwrap().median, 2.0);
    }

    #[test]
    fn errors_that_are_no_numbers_are_none() {
        let mut measurement = Measurement::default();
        assert_eq!((measurement.numeric_error(), measurement.reconstruction_error()), (None, None));
        measurement.numeric = Some(Numeric { rmse: f64::NAN, ..Numeric::default() });
        assert_eq!(measurement.numeric_error(), None);
        measurement.numeric = Some(Numeric::default());
        assert_eq!(measurement.numeric_error(), Some(0.0));
        measurement.reconstruction.insert("psnr_db".into(), 20.0);
        assert!((measurement.reconstruction_error().unwrap() - 0.1).abs() < 1e-15);
        measurement.reconstruction.insert("psnr_db".into(), f64::INFINITY);
        assert_eq!(measurement.reconstruction_error(), Some(0.0));
    }
}
