//! Heat maps of the difference between an image and its reference, on a logarithmic scale of
//! colours.

use rayon::prelude::*;

use super::picture::{self, Grid};
use super::text::tick;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::metrics::largest_difference;

/// Ten samples of "magma" (Smith and van der Walt 2015), from dark to light. Their perceived
/// lightness is even, so they can be read without colour too.
const COLORS: [[u8; 3]; 10] = [
    [0x00, 0x00, 0x04],
    [0x18, 0x0f, 0x3d],
    [0x44, 0x0f, 0x76],
    [0x72, 0x1f, 0x81],
    [0x9e, 0x2f, 0x7f],
    [0xcd, 0x40, 0x71],
    [0xf1, 0x60, 0x5d],
    [0xfd, 0x96, 0x68],
    [0xfe, 0xca, 0x8d],
    [0xfc, 0xfd, 0xbf],
];

/// Position of the smallest difference on the scale of colours, from 0 to 1. Only zero has the
/// lowest colour, so that small differences can be seen.
const FIRST: f64 = 0.2;

/// Most decades of a scale. A difference that lies more decades below the largest one is of no
/// interest.
const MOST_DECADES: i32 = 8;

/// A scale from 10^`low` to 10^`high`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    low: i32,
    high: i32,
}

impl Scale {
    /// Returns the scale that contains all `differences`. Zero needs no place on it: it has its own
    /// colour on any scale.
    pub fn over(differences: impl IntoIterator<Item = f64>) -> Self {
        let positive = differences.into_iter().filter(|d| *d > 0.0 && d.is_finite());
        let (low, high) = positive.fold((f64::INFINITY, 0f64), |(l, h), d| (l.min(d), h.max(d)));
        if high == 0.0 {
            return Self { low: -8, high: 0 };
        }
        let high = (high.log10() - 1e-9).ceil() as i32;
        let low = ((low.log10() + 1e-9).floor() as i32).clamp(high - MOST_DECADES, high - 1);
        Self { low, high }
    }

    /// Returns the sRGB colour of a difference. Zero has the lowest colour; differences beyond the
    /// scale have the colour of its end.
    ///
    /// ```
    /// use epsplat::low_level::report::heatmap::Scale;
    /// let scale = Scale::over([1e-6, 1e-2]);
    /// assert_eq!(scale.color(0.0), [0x00, 0x00, 0x04]);
    /// assert_eq!(scale.color(1e-2), [0xfc, 0xfd, 0xbf]);
    /// ```
    pub fn color(&self, difference: f64) -> [u8; 3] {
        if difference <= 0.0 {
            return COLORS[0];
        }
        // NaN has the highest colour, so that it is noticed.
        let along = (difference.log10() - f64::from(self.low)) / f64::from(self.high - self.low);
        let along = if along.is_nan() { 1.0 } else { FIRST + (1.0 - FIRST) * along.clamp(0.0, 1.0) };
        let place = along * (COLORS.len() - 1) as f64;
        let below = (place as usize).min(COLORS.len() - 2);
        let part = place - below as f64;
        std::array::from_fn(|c| {
            let (from, to) = (f64::from(COLORS[below][c]), f64::from(COLORS[below + 1][c]));
            (from + part * (to - from)).round() as u8
        })
    }

    /// Returns the scale with its numbers, as SVG.
    pub(super) fn legend(&self) -> String {
        const LEFT: f64 = 64.0;
        const WIDTH: f64 = 360.0;
        const PIECES: u32 = 90;
        let rgb = |difference: f64| {
            let [r, g, b] = self.color(difference);
            format!("#{r:02x}{g:02x}{b:02x}")
        };
        let decades = f64::from(self.high - self.low);
        let mut body = format!(
            r#"<rect x="16" y="4" width="24" height="14" fill="{}"/><text x="28" y="33" text-anchor="middle">0</text>"#,
            rgb(0.0)
        );
        let piece = WIDTH / f64::from(PIECES);
        for index in 0..PIECES {
            let power = f64::from(self.low) + decades * (f64::from(index) + 0.5) / f64::from(PIECES);
            let (x, color) = (LEFT + piece * f64::from(index), rgb(10f64.powf(power)));
            // Pieces overlap a little, to hide their seams.
            body += &format!(r#"<rect x="{x:.1}" y="4" width="{:.1}" height="14" fill="{color}"/>"#, piece + 0.4);
        }
        for power in self.low..=self.high {
            let x = LEFT + WIDTH * f64::from(power - self.low) / decades;
            let label = tick(10f64.powi(power));
            body += &format!(
                r#"<path class="axes" d="M{x:.1} 18v4"/><text x="{x:.1}" y="33" text-anchor="middle">{label}</text>"#
            );
        }
        let (from, to) = (tick(10f64.powi(self.low)), tick(10f64.powi(self.high)));
        format!(
            "<svg class=\"scale\" viewBox=\"0 0 460 40\" role=\"img\" aria-label=\"Colours of the difference: 0 is black, \
             then from {from} (dark violet) to {to} (light yellow)\">{body}</svg>"
        )
    }
}

/// Returns the largest absolute difference of each pixel's linear RGBA values.
///
/// # Errors
///
/// [`Error::Usage`] if the two differ in size.
pub fn differences(image: &Frame, reference: &Frame) -> Result<Vec<f64>> {
    if (image.width, image.height) != (reference.width, reference.height) {
        return Err(Error::Usage(format!(
            "an image of {}x{} cannot be compared with a reference of {}x{}",
            image.width, image.height, reference.width, reference.height
        )));
    }
    Ok(image.color.par_iter().zip(&reference.color).map(|(a, b)| largest_difference(a, b)).collect())
}

/// The heat map of one image.
pub(super) struct Map {
    /// Differences by pixel. If the map is shrunk, each value is the largest difference in a block
    /// of pixels, so that no difference is lost.
    pub shown: Grid<f64>,
    /// The largest difference.
    pub largest: f64,
    /// Fraction of pixels that differ.
    pub share: f64,
}

impl Map {
    /// Computes the heat map of an image, shrunk to sides of at most `side`.
    pub fn of(image: &Frame, reference: &Frame, side: u32) -> Result<Self> {
        let differences = differences(image, reference)?;
        let largest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let differing = differences.iter().filter(|difference| **difference > 0.0).count();
        Ok(Self {
            shown: picture::shrink([image.width, image.height, side], &differences, largest),
            largest: largest(&differences),
            share: differing as f64 / differences.len().max(1) as f64,
        })
    }

    /// Encodes the map as an `img` element.
    pub fn picture(&self, scale: Scale, alt: &str) -> Result<String> {
        let rgba = self.shown.values.iter().flat_map(|difference| {
            let [r, g, b] = scale.color(*difference);
            [r, g, b, 255]
        });
        picture::image(self.shown.width, self.shown.height, &rgba.collect::<Vec<u8>>(), alt)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    #[test]
    fn a_difference_has_the_color_of_its_power_of_ten() {
        let scale = Scale::over([0.0, 3e-6, 0.05]);
        assert_eq!(scale, Scale { low: -6, high: -1 });
        assert_eq!(scale.color(0.0), COLORS[0]);
        assert_eq!(scale.color(0.1), COLORS[9]);
        // FIRST of the way, 1.8 steps: the colour of the smallest difference.
        assert_eq!(scale.color(1e-6), [0x3b, 0x0f, 0x6b]);
        // Halfway in decades is halfway from FIRST to the end: 5.4 steps.
        assert_eq!(scale.color(10f64.powf(-3.5)), [0xdb, 0x4d, 0x69]);
        assert_eq!([scale.color(1e-30), scale.color(7.0)], [scale.color(1e-6), scale.color(0.1)]);
        assert_eq!(scale.color(f64::NAN), COLORS[9]);
    }

    #[test]
    fn a_scale_holds_whole_decades_and_at_least_one() {
        assert_eq!(Scale::over([]), Scale { low: -8, high: 0 });
        assert_eq!(Scale::over([1e-3]), Scale { low: -4, high: -3 });
        assert_eq!(Scale::over([1e-30, 1.0]), Scale { low: -8, high: 0 });
        assert_eq!(Scale::over([2.0]), Scale { low: 0, high: 1 });
    }

    #[test]
    fn a_map_shows_each_pixel_and_sizes_must_match() {
        let frame = |width: u32, height: u32, last: f32| {
            let mut frame = Frame::of_colors(width, height, vec![[0.5; 4]; (width * height) as usize]);
            frame.color.last_mut().unwrap()[2] = last;
            frame
        };
        assert_eq!(differences(&frame(2, 1, 0.5), &frame(2, 1, 0.25)).unwrap(), [0.0, 0.25]);
        let message = differences(&frame(2, 1, 0.5), &frame(1, 2, 0.5)).unwrap_err().to_string();
        assert_eq!(message, "an image of 2x1 cannot be compared with a reference of 1x2");
        let map = Map::of(&frame(1024, 2, 0.0), &frame(1024, 2, 0.5), 512).unwrap();
        assert_eq!((map.shown.width, map.shown.height), (512, 1));
        assert_eq!((map.shown.values[0], map.shown.values[511]), (0.0, 0.5));
        assert_eq!((map.largest, map.share), (0.5, 1.0 / 2048.0));
    }
}
