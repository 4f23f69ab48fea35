//! Candidates: points that represent the surface while samples are placed on it, several per
//! sample, spread evenly in each voxel.

use glam::DVec3;
use rayon::prelude::*;

use super::surface::{MeshSurface, Place};
use super::voxels::{Voxel, fan_share};
use crate::random::Random;

/// Candidates per sample: enough to find the centroid of its part of the surface.
const FOR_EACH: f64 = 8.0;

/// A point of the surface, and the area that it represents.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    triangle: u32,
    /// The weights of the first two corners.
    weights: [f32; 2],
    /// The area that it represents, square world units.
    pub(super) area: f32,
}

impl Candidate {
    pub(super) fn place(&self) -> Place {
        let [a, b] = self.weights.map(f64::from);
        Place { triangle: self.triangle, weights: DVec3::new(a, b, 1.0 - a - b) }
    }

    pub(super) fn point(&self, surface: &MeshSurface<'_>) -> DVec3 {
        surface.point(self.place())
    }
}

/// Returns the candidates of all voxels and the start positions of `quotas` samples in each, at
/// evenly spaced candidates of the voxel.
///
/// The `priority` of a voxel is the fractional number of samples that it should have. A voxel gets
/// [`FOR_EACH`] candidates per sample of its priority, or of its quota if that is larger, rounded
/// up; none if both are 0.
pub(super) fn candidates(
    voxels: &[Voxel],
    quotas: &[usize],
    priority: &[f64],
    seed: u64,
) -> (Vec<Candidate>, Vec<Place>) {
    let of_voxel = |(index, voxel): (usize, &Voxel)| {
        let quota = quotas[index];
        let share = priority[index].max(quota as f64);
        let count = if share > 0.0 { (FOR_EACH * share).ceil() as usize } else { 0 };
        let mut random = Random::stream(seed, index as u64);
        let shift = [random.number(), random.number(), random.number()];
        let area = (voxel.area / count as f64) as f32;
        let candidates: Vec<Candidate> = spread(voxel, count, shift)
            .map(|(triangle, weights)| Candidate { triangle, weights: [weights.x as f32, weights.y as f32], area })
            .collect();
        let first = |sample: usize| candidates[(2 * sample + 1) * candidates.len() / (2 * quota)].place();
        let places: Vec<Place> = (0..quota).map(first).collect();
        (candidates, places)
    };
    let (candidates, places): (Vec<_>, Vec<_>) = voxels.par_iter().enumerate().map(of_voxel).unzip();
    (candidates.into_iter().flatten().collect(), places.into_iter().flatten().collect())
}

/// Spreads `count` points over a voxel's surface, and returns their triangles and corner weights.
/// The points proceed by equal steps of area through the list of the voxel's patches. In a patch,
/// they follow the plane lattice R2 (Roberts 2018), shifted by `shift`.
pub(super) fn spread(voxel: &Voxel, count: usize, shift: [f64; 3]) -> impl Iterator<Item = (u32, DVec3)> {
    /// The real root of x^3 = x + 1.
    const PLASTIC: f64 = 1.324_717_957_244_746;
    // Each patch as a fan of triangles, with the cumulative area up to the end of each.
    let mut end = 0.0;
    let mut fans = Vec::with_capacity(voxel.patches.len());
    for patch in &voxel.patches {
        let whole = patch.outline.windows(2).map(|pair| fan_share(patch.outline[0], pair[0], pair[1])).sum::<f64>();
        for pair in patch.outline.windows(2) {
            let [a, b, c] = [patch.outline[0], pair[0], pair[1]];
            let area = patch.area * fan_share(a, b, c) / whole;
            if area > 0.0 {
                end += area;
                fans.push((end, patch.triangle, [a, b, c]));
            }
        }
    }
    let step = end / count as f64;
    (0..count).filter_map(move |k| {
        let upto = (k as f64 + shift[0]) * step;
        let at = fans.partition_point(|(end, ..)| *end <= upto).min(fans.len().checked_sub(1)?);
        let (_, triangle, [a, b, c]) = fans[at];
        let turns = (k + 1) as f64;
        let (mut u, mut v) = ((turns / PLASTIC + shift[1]).fract(), (turns / (PLASTIC * PLASTIC) + shift[2]).fract());
        // The far half of the unit square is reflected onto the near half.
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        Some((triangle, a + (b - a) * u + (c - a) * v))
    })
}
