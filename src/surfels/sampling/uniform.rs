//! Independent random points, uniform by area: the baseline of all other methods.

use glam::DVec3;

use super::surface::{MeshSurface, Place};
use crate::random::Random;

/// Returns `count` points of the surface: random triangles with probabilities proportional to their
/// areas, and a uniformly distributed point in each (Turk 1990).
pub(super) fn places(surface: &MeshSurface<'_>, count: usize, seed: u64) -> Vec<Place> {
    let mut end = 0.0;
    let ends: Vec<f64> = surface
        .triangles
        .iter()
        .map(|triangle| {
            end += triangle.area;
            end
        })
        .collect();
    let last = ends.len().saturating_sub(1);
    let mut random = Random::stream(seed, 0);
    let place = |_| {
        let upto = random.number() * end;
        let triangle = ends.partition_point(|end| *end <= upto).min(last);
        let (mut u, mut v) = (random.number(), random.number());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        Place { triangle: triangle as u32, weights: DVec3::new(1.0 - u - v, u, v) }
    };
    (0..count).map(place).collect()
}
