//! The curve at which two surfaces meet in an image: which surface shows on either side, and how
//! far off the curve is.

use rayon::prelude::*;

use crate::scene::Camera;
use crate::truth::Surface;

/// Pixels within this distance of the curve, in pixels, count for the share of wrong pixels.
pub const BESIDE: f64 = 3.0;

/// Pixels within this distance of the curve, in pixels, count for the curve's offset. A wrong pixel
/// farther away is due to a surface that ends elsewhere, not to a displaced curve.
const FARTHEST: f64 = 32.0;

/// The error of an image near the curve at which two surfaces meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Share of the pixels within [`BESIDE`] of the curve that show the farther surface.
    pub wrong_rate: f64,
    /// Root mean square distance of the visible curve from the true one, pixels.
    pub offset_px: f64,
}

/// Measures, pixel by pixel, whether `first_shows` agrees with the rays of `camera` to the first
/// and the second surface. None if the surfaces meet nowhere in the image.
///
/// The true curve, where the two surfaces meet, runs between neighbouring pixels whose rays hit the
/// two surfaces in opposite order, at the point where the difference of the two depths, linearly
/// interpolated, is 0. The visible curve separates pixels that show either surface. Let it have the
/// length L and lie at the distance d(s) from the true curve. The wrong pixels lie between the two
/// curves. Their distances from the true curve add up to the integral of `d^2/2` over s, so
/// `rms^2 = 2 / L * sum of distances`. L is the area of the pixels within [`BESIDE`] of the curve,
/// divided by the width of that strip.
pub fn joint(first_shows: &[bool], camera: &Camera, surfaces: [&Surface; 2]) -> Option<Joint> {
    let difference = |pixel: usize| {
        let (x, y) = (pixel as u32 % camera.width, pixel as u32 / camera.width);
        let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        let (start, ray) = (camera.ray_start(x, y), camera.ray(x, y));
        if !camera.shows(x, y) {
            return None;
        }
        let [first, second] = surfaces.map(|surface| surface.first_hit(start, ray, camera.near));
        Some(first?.distance - second?.distance)
    };
    let differences: Vec<Option<f64>> = (0..first_shows.len()).into_par_iter().map(difference).collect();
    let distances = distances(&differences, camera.width as usize);
    let (mut beside, mut wrong, mut moment) = (0.0, 0.0, 0.0);
    for (pixel, distance) in distances.into_iter().enumerate() {
        let Some(difference) = differences[pixel].filter(|_| distance <= FARTHEST) else { continue };
        let is_wrong = (difference < 0.0) != first_shows[pixel];
        if distance <= BESIDE {
            beside += 1.0;
            wrong += f64::from(u8::from(is_wrong));
        }
        moment += if is_wrong { distance } else { 0.0 };
    }
    let length = beside / (2.0 * BESIDE);
    (beside > 0.0).then(|| Joint { wrong_rate: wrong / beside, offset_px: (2.0 * moment / length).sqrt() })
}

/// Returns the distance of each pixel, in rows of `width`, from the nearest place where
/// `differences` are 0, pixels; more than [`FARTHEST`] if that is farther.
fn distances(differences: &[Option<f64>], width: usize) -> Vec<f64> {
    let mut distances = vec![f64::INFINITY; differences.len()];
    let height = differences.len() / width.max(1);
    let reach = FARTHEST.ceil() as usize + 1;
    let mut mark = |x: f64, y: f64| {
        for row in (y as usize).saturating_sub(reach)..(y as usize + reach + 1).min(height) {
            for column in (x as usize).saturating_sub(reach)..(x as usize + reach + 1).min(width) {
                let distance = (column as f64 - x).hypot(row as f64 - y);
                let known = &mut distances[row * width + column];
                *known = known.min(distance);
            }
        }
    };
    for (pixel, here) in differences.iter().enumerate() {
        let (x, y) = (pixel % width, pixel / width);
        for (dx, dy) in [(1, 0), (0, 1)] {
            let there = if x + dx < width && y + dy < height { differences[pixel + dx + dy * width] } else { None };
            if let (Some(a), Some(b)) = (*here, there)
                && (a < 0.0) != (b < 0.0)
            {
                let t = a / (a - b);
                mark(x as f64 + t * dx as f64, y as f64 + t * dy as f64);
            }
        }
    }
    distances
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::DVec3;

    use super::*;
    use crate::scene::{Lens, Up};
    use crate::surfels::analytic::{Shape, mesh};

    /// Two planes cross in a line down the image; the visible line is a known number of pixels off.
    #[test]
    fn an_offset_is_measured_in_pixels() {
        let eye = DVec3::new(0.0, 0.0, 5.0);
        let lens = Lens::OrthographicHeight(1.6);
        let camera = Camera::look_at((100, 100), lens, eye, DVec3::ZERO, Some(DVec3::Y), Up::Y, 0.1).unwrap();
        let mut tilted = mesh(Shape::Plane, 2);
        tilted.positions.iter_mut().for_each(|p| p[2] = 0.7 * p[0]);
        let surfaces = [Surface::Analytic(Shape::Plane), Surface::mesh(&tilted).unwrap()];
        let of = |off: u32| {
            // The tilted plane is nearer on the right of the middle.
            let shown: Vec<bool> = (0..100 * 100).map(|pixel| pixel % 100 < 50 + off).collect();
            joint(&shown, &camera, surfaces.each_ref()).unwrap()
        };
        for off in [0, 1, 2, 6] {
            let Joint { wrong_rate, offset_px } = of(off);
            assert!((offset_px - f64::from(off)).abs() < 0.01, "{off}: {offset_px}");
            assert!((wrong_rate - f64::from(off.min(3)) / 6.0).abs() < 0.01, "{off}: {wrong_rate}");
        }
        // In this view the planes do not meet.
        let far = Camera { eye: eye + 3.0 * DVec3::X, ..camera.clone() };
        assert_eq!(joint(&vec![true; 100 * 100], &far, surfaces.each_ref()), None);
    }
}
