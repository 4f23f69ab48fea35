//! The error of one image against another.

use rayon::prelude::*;
use serde::Serialize;

use super::{ColorError, largest_difference, same_size};
use crate::error::Result;
use crate::frame::Frame;
use crate::scene::{MAPS, Map};

/// The relative margin within which f32 may rightly decide a fragment otherwise. Pixels with a
/// fragment nearer to a decision are excluded from [`Comparison::rmse_decided`] and
/// [`Comparison::max_abs_decided`].
pub const DECISION_MARGIN: f32 = 1e-6;

/// Memory that [`compare`] takes in addition to the images, bytes per pixel at most.
pub const BYTES_PER_PIXEL: u64 = 48;

/// The error of image A against image B. Colours are compared as linear RGBA.
///
/// A value that is not finite differs from any other by the largest f32. [`MapError::not_finite`]
/// counts such pixels, and [`Comparison::is_finite`] is true if there are none.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Largest absolute difference of a value.
    pub max_abs: f64,
    /// Root of the mean squared difference of all values.
    pub rmse: f64,
    /// Peak signal-to-noise ratio for a peak of 1, dB; null if the images are equal.
    pub psnr_db: Option<f64>,
    /// Share of pixels that one image covers (alpha > 0) and the other does not.
    pub coverage_mismatch: f64,
    /// 99.9th percentile over pixels of the largest absolute difference in the pixel.
    pub percentile_99_9: f64,
    /// The errors of the maps that both images have; the colour counts as two, RGB and alpha.
    pub maps: Vec<MapError>,
    /// The maps that only A has; they are not compared.
    pub only_in_a: Vec<&'static str>,
    /// The maps that only B has; they are not compared.
    pub only_in_b: Vec<&'static str>,
    /// Share of pixels that are excused because a fragment lies within [`DECISION_MARGIN`] of a
    /// decision; only if A or B has a `decision` map.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excused: Option<f64>,
    /// [`rmse`](Self::rmse) over the pixels that are not excused; only if there is a `decision`
    /// map.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rmse_decided: Option<f64>,
    /// [`max_abs`](Self::max_abs) over the same pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_abs_decided: Option<f64>,
}

/// The error of one map, relative to the range that B's values span.
#[derive(Clone, Debug, Serialize)]
pub struct MapError {
    /// The name of the map, such as color (RGB), alpha, depth or normal.
    pub map: &'static str,
    /// Largest minus smallest finite value of B. If that is under 1/1000 of the largest magnitude,
    /// it is the largest magnitude.
    pub range: f64,
    /// Pixels where two values differ and one of them is not finite, except those of
    /// [`in_one`](Self::in_one).
    pub not_finite: u64,
    /// Pixels where one image has the map's background values, which include an infinite depth, and
    /// the other has finite values.
    pub in_one: u64,
    /// Largest absolute difference over all pixels but those of [`in_one`](Self::in_one).
    pub max_abs: f64,
    /// [`max_abs`](Self::max_abs) as a fraction of the range; 1 for any error if B's values are all
    /// 0.
    pub max_of_range: f64,
    /// [`max_of_range`](Self::max_of_range) over the pixels that are not excused; only if there is
    /// a `decision` map.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_of_range_decided: Option<f64>,
}

impl Comparison {
    /// Whether no differing value is infinite or NaN, so that all measures are meaningful.
    pub fn is_finite(&self) -> bool {
        self.maps.iter().all(|map| map.not_finite == 0)
    }
}

/// B's values are nearly equal if they span less than this fraction of the largest.
const NEARLY_ONE: f64 = 1e-3;

/// Compares `a` with `b`.
///
/// # Errors
///
/// [`Error::Usage`](crate::Error::Usage) if the images differ in size.
pub fn compare(a: &Frame, b: &Frame) -> Result<Comparison> {
    same_size(a, b)?;
    let pixels = a.color.len();
    let values = |color: &[f32; 4]| color.map(f64::from);
    let colors = a.color.par_iter().zip(&b.color).map(|(a, b)| (values(a), values(b)));
    let color = ColorError::of(colors.clone());
    let uncovered = a.color.iter().zip(&b.color).filter(|(a, b)| (a[3] > 0.0) != (b[3] > 0.0)).count();

    let decision = b.map(Map::Decision).or(a.map(Map::Decision));
    let excused: Option<Vec<bool>> = decision.map(|map| map.iter().map(|d| *d < DECISION_MARGIN).collect());
    let decided = excused.as_ref().map(|excused| {
        let kept = colors.zip(excused).filter(|(_, excused)| !**excused);
        ColorError::of(kept.map(|(pair, _)| pair))
    });
    let excused = excused.as_deref();
    let mut maps = vec![
        map_error("color", pixels, |pixel| (&a.color[pixel][..3], &b.color[pixel][..3]), &[], excused),
        map_error("alpha", pixels, |pixel| (&a.color[pixel][3..], &b.color[pixel][3..]), &[], excused),
    ];
    for row in MAPS.iter().filter(|row| row.compared) {
        let Some((a, b)) = a.map(row.map).zip(b.map(row.map)) else { continue };
        let of = |pixel: usize| pixel * row.map.width()..(pixel + 1) * row.map.width();
        maps.push(map_error(row.name, pixels, |pixel| (&a[of(pixel)], &b[of(pixel)]), row.nothing, excused));
    }
    Ok(Comparison {
        max_abs: color.max_abs,
        rmse: color.rmse,
        psnr_db: color.psnr_db,
        coverage_mismatch: uncovered as f64 / pixels as f64,
        percentile_99_9: color.percentile_99_9,
        maps,
        only_in_a: only_in(a, b),
        only_in_b: only_in(b, a),
        excused: excused.map(|excused| excused.iter().filter(|e| **e).count() as f64 / pixels as f64),
        rmse_decided: decided.as_ref().map(|error| error.rmse),
        max_abs_decided: decided.as_ref().map(|error| error.max_abs),
    })
}

/// The maps beside the colour that `a` has and `b` lacks.
fn only_in(a: &Frame, b: &Frame) -> Vec<&'static str> {
    a.maps().iter().filter(|map| !b.maps().has(*map)).map(|map| map.row().name).collect()
}

/// The error of a map. `at` returns the values of A and of B in each of the `pixels`, and `nothing`
/// are the map's values in the background.
fn map_error<'a>(
    map: &'static str,
    pixels: usize,
    at: impl Fn(usize) -> (&'a [f32], &'a [f32]),
    nothing: &[f32],
    excused: Option<&[bool]>,
) -> MapError {
    let (mut low, mut high, mut not_finite, mut in_one) = (f32::INFINITY, f32::NEG_INFINITY, 0, 0);
    let marks = nothing.contains(&f32::INFINITY);
    let (mut max_abs, mut max_decided) = (0f64, 0f64);
    for pixel in 0..pixels {
        let (a, b) = at(pixel);
        for &value in b.iter().filter(|value| value.is_finite()) {
            (low, high) = (low.min(value), high.max(value));
        }
        // Infinite depth marks the background.
        let [empty, other_empty] = [a, b].map(|values| marks && values == nothing);
        if empty && other_empty {
            continue;
        }
        if (empty || other_empty) && (if empty { b } else { a }).iter().all(|value| value.is_finite()) {
            in_one += 1;
            continue;
        }
        let other = |(a, b): (&f32, &f32)| a != b && !(a.is_finite() && b.is_finite());
        not_finite += u64::from(a.iter().zip(b).any(other));
        let difference = largest_difference(a, b);
        max_abs = max_abs.max(difference);
        if excused.is_some_and(|excused| !excused[pixel]) {
            max_decided = max_decided.max(difference);
        }
    }
    let (span, most) = (f64::from(high) - f64::from(low), f64::from(high.abs().max(low.abs())));
    let range = if high < low {
        0.0
    } else if span < NEARLY_ONE * most {
        most
    } else {
        span
    };
    let of_range = |error: f64| match error > 0.0 && range == 0.0 {
        true => 1.0,
        false => (error / range.max(f64::MIN_POSITIVE)).min(f32::MAX.into()),
    };
    MapError {
        map,
        range,
        not_finite,
        in_one,
        max_abs,
        max_of_range: of_range(max_abs),
        max_of_range_decided: excused.map(|_| of_range(max_decided)),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn frame(values: &[f32]) -> Frame {
        Frame::of_colors(values.len() as u32, 1, values.iter().map(|v| [*v, 0.0, 0.0, 1.0]).collect())
    }

    #[test]
    fn equal_images_have_no_error_and_known_ones_the_right_one() {
        let a = frame(&[0.0, 0.5, 1.0, 0.25]);
        let same = compare(&a, &a).unwrap();
        assert_eq!((same.max_abs, same.rmse, same.psnr_db), (0.0, 0.0, None));
        let b = frame(&[0.0, 0.5, 1.0, 0.75]);
        let c = compare(&a, &b).unwrap();
        assert_eq!(c.max_abs, 0.5);
        // One value of sixteen differs by one half.
        assert!((c.rmse - 0.125).abs() < 1e-12);
        assert!((c.psnr_db.unwrap() - 18.0618).abs() < 1e-3);
        assert_eq!(c.percentile_99_9, 0.5);
    }

    #[test]
    fn nan_coverage_and_excuses_are_seen() {
        let a = frame(&[f32::NAN, 0.5]);
        let mut b = frame(&[0.0, 0.5]);
        let c = compare(&a, &b).unwrap();
        assert_eq!(c.max_abs, f64::from(f32::MAX));
        assert!(c.psnr_db.unwrap() < -700.0 && c.maps[0].max_abs > 1e38);
        assert_eq!((c.maps[0].not_finite, c.maps[1].not_finite), (1, 0));
        b.color[1][3] = 0.0;
        assert_eq!(compare(&a, &b).unwrap().coverage_mismatch, 0.5);
        let a = frame(&[0.0, 0.5, 0.5]);
        let b = frame(&[1.0, 0.5, 0.0]);
        let b = b.with(Map::Decision, vec![1.0, 1.0, 1e-8]);
        let c = compare(&a, &b).unwrap();
        assert_eq!(c.excused, Some(1.0 / 3.0));
        assert_eq!(c.maps[0].max_of_range_decided, Some(1.0));
        let b = b.with(Map::Decision, vec![1e-8, 1.0, 1.0]);
        let c = compare(&a, &b).unwrap();
        assert_eq!(c.maps[0].max_of_range_decided, Some(0.5));
        // One value of the eight in two pixels differs by one half; over all three pixels the first
        // counts too.
        assert_eq!((c.max_abs, c.max_abs_decided), (1.0, Some(0.5)));
        assert!((c.rmse_decided.unwrap() - (0.25f64 / 8.0).sqrt()).abs() < 1e-12 && c.rmse > 0.3);
        let b = b.with(Map::Decision, vec![1e-8; 3]);
        let c = compare(&a, &b).unwrap();
        assert_eq!((c.excused, c.rmse_decided, c.max_abs_decided), (Some(1.0), Some(0.0), Some(0.0)));
        let b = b.without(Map::Decision);
        let c = compare(&a, &b).unwrap();
        assert_eq!((c.rmse_decided, c.max_abs_decided), (None, None));
        assert!(!serde_json::to_string(&c).unwrap().contains("decided"));
        assert!(compare(&a, &frame(&[0.0])).is_err());
    }

    #[test]
    fn maps_of_one_image_are_named_and_a_map_without_range_has_a_finite_error() {
        let (mut a, mut b) = (frame(&[0.5, 0.5]), frame(&[0.5, 0.25]));
        a = a.with(Map::Depth, vec![1.0, f32::INFINITY]).with(Map::Weight, vec![2.0, 2.0]);
        b = b.with(Map::Depth, vec![1.5, 1.5]).with(Map::Count, vec![1.0, 1.0]);
        let c = compare(&a, &b).unwrap();
        assert_eq!((c.only_in_a, c.only_in_b), (vec!["weight"], vec!["count"]));
        // Pixels that are background in one image do not count as depth errors. All depths of B are
        // equal.
        let depth = &c.maps[2];
        assert_eq!((depth.map, depth.range, depth.max_abs, depth.max_of_range), ("depth", 1.5, 0.5, 0.5 / 1.5));
        assert_eq!((depth.in_one, compare(&b, &a).unwrap().maps[2].in_one, depth.not_finite), (1, 1, 0));
        assert!(c.maps.iter().all(|map| map.not_finite == 0 && map.max_of_range <= 1.0), "{:?}", c.maps);
        assert_eq!(compare(&a, &a).unwrap().maps[2].max_of_range, 0.0);
        // An alpha that hardly varies must not have a large relative error.
        let [one, other] = [1.0, 1.0 - f32::EPSILON].map(|alpha| {
            Frame::of_colors(2, 1, vec![[0.5, 0.5, 0.5, alpha], [0.5, 0.5, 0.5, 1.0 - 0.5 * f32::EPSILON]])
        });
        let alpha = &compare(&one, &other).unwrap().maps[1];
        assert!(alpha.max_abs > 1e-8 && alpha.max_of_range < 2e-7, "{alpha:?}");
        let zero = |value: f32| frame(&[value, value]);
        assert_eq!(compare(&zero(0.5), &zero(0.0)).unwrap().maps[0].max_of_range, 1.0);
    }

    #[test]
    fn maps_in_which_one_image_has_nothing_are_told_apart_from_what_is_not_finite() {
        let texz = |values: [f32; 6]| frame(&[0.5, 0.5]).with(Map::TexZ, values.to_vec());
        let right = texz([0.25, 0.5, 3.0, 0.0, 0.0, f32::INFINITY]);
        let zeros = texz([0.25, 0.5, 3.0, 0.0, 0.0, 0.0]);
        for (a, b) in [(&right, &zeros), (&zeros, &right)] {
            let map = compare(a, b).unwrap().maps.pop().unwrap();
            assert_eq!((map.map, map.in_one, map.not_finite, map.max_abs), ("texz", 1, 0, 0.0));
        }
        let wrong = texz([0.25, 0.5, f32::NAN, 0.0, 0.0, f32::NAN]);
        let found = compare(&wrong, &right).unwrap();
        assert_eq!((found.maps[2].in_one, found.maps[2].not_finite, found.is_finite()), (0, 2, false));
    }
}
