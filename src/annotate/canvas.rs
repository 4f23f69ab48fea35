//! Shapes on the colour of a frame. Coordinates are pixels from the top left corner.

use crate::frame::Frame;
use crate::scene::color::decoded;

/// Samples along x and y of a pixel of a polygon.
const SAMPLES: usize = 4;

/// The sRGB codes of panels behind marks, with alpha, and of the marks.
pub(super) const PANEL: [u8; 4] = [255, 255, 255, 224];
pub(super) const INK: [u8; 4] = [20, 20, 20, 255];

/// The colour of a frame.
pub(super) struct Canvas<'a> {
    pub width: usize,
    pub height: usize,
    color: &'a mut [[f32; 4]],
}

impl<'a> Canvas<'a> {
    pub fn of(frame: &'a mut Frame) -> Self {
        Self { width: frame.width as usize, height: frame.height as usize, color: &mut frame.color }
    }

    /// The size of letters that suits the picture, pixels.
    pub fn letters(&self) -> f32 {
        (self.width.min(self.height) as f32 / 36.0).max(9.0)
    }

    /// Draws a linear colour with straight alpha over a pixel, of which it covers a share. Pixels
    /// outside of the picture are ignored.
    pub fn cover(&mut self, x: i64, y: i64, [r, g, b, alpha]: [f32; 4], share: f32) {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return };
        if x >= self.width || y >= self.height {
            return;
        }
        let Some(pixel) = self.color.get_mut(y * self.width + x) else { return };
        let above = alpha * share.clamp(0.0, 1.0);
        let below = pixel[3] * (1.0 - above);
        let sum = above + below;
        if above <= 0.0 {
            return;
        }
        for (channel, value) in [r, g, b].into_iter().enumerate() {
            pixel[channel] = (above * value + below * pixel[channel]) / sum;
        }
        pixel[3] = sum;
    }

    /// Fills the pixels of a box, given by its corner and its size.
    pub fn fill(&mut self, [x, y]: [i64; 2], [width, height]: [i64; 2], code: [u8; 4]) {
        let color = decoded(code);
        for y in y..y + height {
            (x..x + width).for_each(|x| self.cover(x, y, color, 1.0));
        }
    }

    /// Fills a convex polygon with smooth edges.
    pub fn polygon(&mut self, corners: &[[f64; 2]], code: [u8; 4]) {
        let color = decoded(code);
        let ends = |axis: usize| {
            let of =
                |start: f64, both: fn(f64, f64) -> f64| corners.iter().map(|corner| corner[axis]).fold(start, both);
            of(f64::INFINITY, f64::min).floor() as i64..of(f64::NEG_INFINITY, f64::max).ceil() as i64
        };
        let next = corners.iter().cycle().skip(1);
        let edges: Vec<([f64; 2], [f64; 2])> = corners.iter().copied().zip(next.copied()).collect();
        let side = |[x, y]: [f64; 2], (from, to): &([f64; 2], [f64; 2])| {
            (to[0] - from[0]) * (y - from[1]) - (to[1] - from[1]) * (x - from[0])
        };
        let is_inside = |point: [f64; 2]| {
            edges.iter().all(|edge| side(point, edge) >= 0.0) || edges.iter().all(|edge| side(point, edge) <= 0.0)
        };
        let place = |pixel: i64, sample: usize| pixel as f64 + (sample as f64 + 0.5) / SAMPLES as f64;
        for y in ends(1) {
            for x in ends(0) {
                let samples = (0..SAMPLES * SAMPLES).map(|k| [place(x, k % SAMPLES), place(y, k / SAMPLES)]);
                let share = samples.filter(|point| is_inside(*point)).count() as f32 / (SAMPLES * SAMPLES) as f32;
                self.cover(x, y, color, share);
            }
        }
    }
}
