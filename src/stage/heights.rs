//! Maps that are made from others after a frame is rendered: heights from depths.

use glam::DVec3;
use rayon::prelude::*;

use crate::frame::Frame;
use crate::scene::{Camera, Map, Maps};

/// Adds the maps of `wanted` that are made from others, and removes those that were rendered for
/// them alone. `up` is the axis of heights, of length 1.
pub(super) fn made(frame: Frame, camera: &Camera, up: DVec3, wanted: Maps) -> Frame {
    let heights = match frame.map(Map::Depth) {
        Some(depths) if wanted.has(Map::Height) => of_depths(depths, camera, up),
        _ => return frame,
    };
    let frame = frame.with(Map::Height, heights);
    if wanted.has(Map::Depth) { frame } else { frame.without(Map::Depth) }
}

/// Returns the world coordinate along `up` of each pixel's surface; -inf where nothing is visible.
fn of_depths(depths: &[f32], camera: &Camera, up: DVec3) -> Vec<f32> {
    let height = |(pixel, depth): (usize, &f32)| {
        if !depth.is_finite() {
            return f32::NEG_INFINITY;
        }
        let width = camera.width as usize;
        let (x, y) = ((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
        let at = camera.ray_start(x, y) + camera.ray(x, y) * f64::from(*depth);
        at.dot(up) as f32
    };
    depths.par_iter().enumerate().map(height).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::{Lens, Up};

    /// The plane z = 3 has the height 3 at every pixel of a slanted view.
    #[test]
    fn a_level_plane_has_one_height() {
        let (eye, target) = (DVec3::new(10.0, -20.0, 30.0), DVec3::new(1.0, 2.0, 3.0));
        for lens in [Lens::Fov(40.0), Lens::OrthographicHeight(12.0)] {
            let camera = Camera::look_at((7, 5), lens, eye, target, None, Up::Z, 0.1).unwrap();
            let depth = |pixel: usize| {
                let (x, y) = ((pixel % 7) as f64 + 0.5, (pixel / 7) as f64 + 0.5);
                ((3.0 - camera.ray_start(x, y).z) / camera.ray(x, y).z) as f32
            };
            let mut depths: Vec<f32> = (0..35).map(depth).collect();
            depths[4] = f32::INFINITY;
            let frame = Frame::of_colors(7, 5, vec![[0.0; 4]; 35]).with(Map::Depth, depths);
            let made = made(frame, &camera, DVec3::Z, Maps::of(&[Map::Height]));
            assert!(made.map(Map::Depth).is_none());
            let heights = made.map(Map::Height).unwrap();
            assert_eq!(heights[4], f32::NEG_INFINITY);
            assert!(heights.iter().enumerate().all(|(pixel, height)| pixel == 4 || (height - 3.0).abs() < 1e-5));
        }
    }
}
