//! Eye-dome lighting: darkens pixels that lie behind their neighbours, so that the shape of a cloud
//! without normals can be seen (Boucheny 2009, *Interactive scientific visualization of large
//! datasets*, chapter 4, with the one scale of Potree and with the depths of this renderer).
//!
//! For a pixel of depth z and its neighbours i in eight directions, at a distance of r pixels,
//!
//! ```text
//! slope_i = max(0, (z - z_i) s / r_i)      s = f / z (pinhole) or f (orthographic)
//! x       = C strength (sum of slope_i) / 8
//! shade   = 1 / (1 + x + x^2 / 2)
//! ```
//!
//! s is the number of pixels in a world unit at the pixel's depth, so slopes are tangents of angles
//! to the plane of the image: the effect depends neither on the unit of length nor on the scale of
//! the picture. Neighbours without a depth count 0. The shade is that of exp(-x) up to its second
//! order, in operations that every processor rounds alike, so that the bits of the picture are the
//! same everywhere. It multiplies the colour in linear light.
//!
//! This is a filter of the finished [`Frame`]: the host computes it in f64 from the map of depths,
//! which is taken at the centres of pixels whatever the number of samples.

use rayon::prelude::*;

use crate::frame::Frame;
use crate::scene::{Camera, EyeDome, Map, Projection};

/// C above: with strength 1, shades are near those of Potree's default on a display of 1080 rows.
const SCALE: f64 = 0.45;

/// Rows or columns of the image, whichever are fewer, for each pixel of the distance of neighbours.
/// Outlines thus have the same width in a picture and in its enlargement.
const SIDE: u32 = 1024;

/// The eight directions to neighbours, in pixels.
const NEIGHBOURS: [[i64; 2]; 8] = [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]];

/// Multiplies the colour of each pixel of `frame`, a picture of `camera` with the map of depths, by
/// its shade. A frame without that map stays as it is.
pub fn light(frame: &mut Frame, camera: &Camera, EyeDome(strength): EyeDome) {
    let Some(depths) = frame.map(Map::Depth).map(<[f32]>::to_vec) else { return };
    let width = frame.width as usize;
    let shades = Shades { depths: &depths, size: [frame.width, frame.height].map(i64::from), camera, strength };
    frame.color.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, colors)| {
        for (column, color) in colors.iter_mut().enumerate() {
            let shade = shades.at(column as i64, row as i64);
            color[..3].iter_mut().for_each(|channel| *channel = (f64::from(*channel) * shade) as f32);
        }
    });
}

/// The shades of a picture's pixels.
struct Shades<'a> {
    /// Camera-space z of each pixel, world units; +inf where nothing is visible.
    depths: &'a [f32],
    /// Width and height, pixels.
    size: [i64; 2],
    camera: &'a Camera,
    strength: f64,
}

impl Shades<'_> {
    /// Returns the depth of a pixel; `None` outside the image and where nothing is visible.
    fn depth(&self, column: i64, row: i64) -> Option<f64> {
        let [width, height] = self.size;
        let inside = (0..width).contains(&column) && (0..height).contains(&row);
        let depth = inside.then(|| f64::from(self.depths[(row * width + column) as usize]));
        depth.filter(|depth| depth.is_finite())
    }

    /// Returns the factor of a pixel's colour, from 0 to 1.
    fn at(&self, column: i64, row: i64) -> f64 {
        let Some(z) = self.depth(column, row) else { return 1.0 };
        let [width, height] = self.size;
        let radius = (width.min(height) / i64::from(SIDE)).max(1);
        let focal = 0.5 * (self.camera.fx + self.camera.fy);
        let scale = if self.camera.projection == Projection::Pinhole { focal / z } else { focal };
        let slope = |[x, y]: [i64; 2]| {
            let Some(other) = self.depth(column + radius * x, row + radius * y) else { return 0.0 };
            let distance = radius as f64 * if x != 0 && y != 0 { std::f64::consts::SQRT_2 } else { 1.0 };
            ((z - other) * scale / distance).max(0.0)
        };
        let sum: f64 = NEIGHBOURS.into_iter().map(slope).sum();
        let x = SCALE * self.strength * sum / NEIGHBOURS.len() as f64;
        1.0 / (1.0 + x + 0.5 * x * x)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::{Lens, Maps, Up};
    use glam::DVec3;

    /// A white picture of these depths by a camera that shows `height` world units, or with a field
    /// of view of 90 degrees for `None`.
    fn lit(depths: &[f32], (width, height): (u32, u32), ortho: Option<f64>) -> Vec<f32> {
        let lens = ortho.map_or(Lens::Fov(90.0), Lens::OrthographicHeight);
        let camera = Camera::look_at((width, height), lens, DVec3::ZERO, DVec3::NEG_Z, None, Up::Y, 1e-3).unwrap();
        let mut frame = Frame::new(&camera, Maps::NONE).with(Map::Depth, depths.to_vec());
        frame.color.fill([1.0; 4]);
        light(&mut frame, &camera, EyeDome(1.0));
        assert!(frame.color.iter().all(|color| color[3] == 1.0 && color[0] == color[2]));
        frame.color.iter().map(|color| color[0]).collect()
    }

    #[test]
    fn a_plane_across_the_view_stays_and_a_step_is_dark_behind() {
        assert_eq!(lit(&[3.0; 16], (4, 4), None), [1.0; 16]);
        // A step of one world unit, half a pixel's width in this view, between two columns.
        let depths = [2.0, 2.0, 3.0, 3.0].repeat(3);
        let shades = lit(&depths, (4, 3), Some(6.0));
        let tangent = 1.0 * 3.0 / 6.0;
        let x = 0.45 * tangent * (1.0 + 2.0 / 2f64.sqrt()) / 8.0;
        let expected = (1.0 / (1.0 + x + x * x / 2.0)) as f32;
        assert_eq!(shades[4..8], [1.0, 1.0, expected, 1.0]);
    }

    #[test]
    fn neither_the_unit_of_length_nor_the_resolution_of_a_slope_counts() {
        let slope = |unit: f32| -> Vec<f32> { (0..25).map(|k| unit * (50.0 + (k % 5) as f32)).collect() };
        let [one, thousand] = [1.0, 1000.0].map(|unit| lit(&slope(unit), (5, 5), None));
        assert_eq!(one, thousand);
        assert!(one[12] < 1.0);
        // Twice the pixels of a plane have half the steps.
        let fine: Vec<f32> = (0..100).map(|k| 50.0 + 0.5 * (k % 10) as f32).collect();
        let [coarse, fine] = [(slope(1.0), 5), (fine, 10)].map(|(depths, side)| lit(&depths, (side, side), Some(5.0)));
        assert_eq!(coarse[12], fine[45]);
    }

    #[test]
    fn pixels_without_a_depth_neither_darken_nor_are_darkened() {
        let mut depths = [4.0; 9];
        depths[4] = f32::INFINITY;
        assert_eq!(lit(&depths, (3, 3), None), [1.0; 9]);
    }
}
