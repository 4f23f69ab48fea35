//! Error measures of images and surfels.
//!
//! They compare one image with another ([`numeric`]), a render with the surface that its surfels
//! stand for ([`reconstruction`](mod@reconstruction)), and the surfels with that surface without
//! any render: the holes that they leave ([`coverage`](mod@coverage)) and their distances from it
//! ([`distance`]).

pub mod coverage;
pub mod distance;
pub mod joint;
pub mod numeric;
pub mod reconstruction;
mod ssim;

use rayon::prelude::*;

pub use coverage::{Coverage, coverage};
pub use distance::{Distances, SurfaceDistances};
pub use joint::{Joint, joint};
pub use numeric::{BYTES_PER_PIXEL, Comparison, DECISION_MARGIN, MapError, compare};
pub use reconstruction::{DepthError, NormalError, Reconstruction, reconstruction};

use crate::error::{Error, Result};
use crate::frame::Frame;

/// The error of one image's colours against another's, over all values.
struct ColorError {
    max_abs: f64,
    rmse: f64,
    psnr_db: Option<f64>,
    percentile_99_9: f64,
}

impl ColorError {
    /// Compares pairs of pixels of four values each.
    fn of(pixels: impl ParallelIterator<Item = ([f64; 4], [f64; 4])>) -> Self {
        let in_pixel = |(a, b): ([f64; 4], [f64; 4])| {
            let squared: f64 = a.iter().zip(&b).map(|(a, b)| difference(*a, *b).powi(2)).sum();
            (squared, largest_difference(&a, &b))
        };
        let (squared, worst): (Vec<f64>, Vec<f64>) = pixels.map(in_pixel).unzip();
        let rmse = (squared.iter().sum::<f64>() / (4 * squared.len()).max(1) as f64).sqrt();
        let worst = Sorted::new(worst);
        Self {
            max_abs: worst.percentile(1.0).unwrap_or(0.0),
            rmse,
            psnr_db: (rmse > 0.0).then(|| -20.0 * rmse.log10()),
            percentile_99_9: worst.percentile(0.999).unwrap_or(0.0),
        }
    }
}

/// Errors in ascending order.
struct Sorted(Vec<f64>);

impl Sorted {
    fn new(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        Self(values)
    }

    /// Returns the smallest value that at least this share of the values do not exceed (nearest
    /// rank); None if there are no values.
    fn percentile(&self, share: f64) -> Option<f64> {
        let rank = (self.0.len() as f64 * share).ceil() as usize;
        self.0.get(rank.max(1) - 1).copied()
    }
}

fn same_size(a: &Frame, b: &Frame) -> Result<()> {
    if (a.width, a.height) == (b.width, b.height) {
        return Ok(());
    }
    Err(Error::Usage(format!("the images differ in size: {}x{} and {}x{}", a.width, a.height, b.width, b.height)))
}

/// The absolute difference. A value that is not finite differs from any other by the largest f32:
/// it must neither count as equal nor make the other measures meaningless.
fn difference<T: Into<f64>>(a: T, b: T) -> f64 {
    let (a, b) = (a.into(), b.into());
    if a == b {
        return 0.0;
    }
    let difference = (a - b).abs();
    if difference.is_finite() { difference } else { f32::MAX.into() }
}

pub(crate) fn largest_difference<T: Copy + Into<f64>>(a: &[T], b: &[T]) -> f64 {
    a.iter().zip(b).map(|(a, b)| difference(*a, *b)).fold(0.0, f64::max)
}
