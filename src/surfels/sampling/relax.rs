//! Relaxation: samples move apart until each is near the centroid of its part of the surface.

use glam::DVec3;
use rayon::prelude::*;

use super::candidates::Candidate;
use super::surface::{MeshSurface, Place};
use crate::error::Result;
use crate::progress::Progress;
use crate::scene::color::mean_color;
use crate::surfels::neighbours::{Neighbour, NeighbourSearch};
use crate::surfels::positions::DistinctPositions;
use crate::truth::nearest::closest_weights;

/// Rounds of relaxation.
const ROUNDS: usize = 10;

/// The candidates nearest to each sample.
pub(super) struct Cells {
    /// Indices of candidates, sorted by sample.
    members: Vec<u32>,
    /// The start of each sample's candidates in `members`, and the end of the last one's.
    starts: Vec<usize>,
}

impl Cells {
    fn new(surface: &MeshSurface<'_>, candidates: &[Candidate], samples: &[Place]) -> Result<Self> {
        let points: Vec<[f64; 3]> = samples.par_iter().map(|place| surface.point(*place).to_array()).collect();
        let distinct = DistinctPositions::new(&points, &surface.bounds, DVec3::ZERO)?;
        // The first of several coincident samples gets the cell; the others stay where they are.
        let mut sample_at = vec![u32::MAX; distinct.len()];
        for (sample, &position) in distinct.of_point().iter().enumerate().rev() {
            sample_at[position as usize] = sample as u32;
        }
        let search = NeighbourSearch::new(&distinct, 1);
        // Most candidates lie near the one before.
        let nearest = |found: &mut Vec<Neighbour>, candidate: &Candidate| {
            let before = found.first().map_or(0, |nearest| nearest.index);
            search.nearest_to(candidate.point(surface) * distinct.scale(), before, found);
            found.first().map_or(0, |nearest| sample_at[nearest.index as usize])
        };
        let owners: Vec<u32> = candidates.par_iter().map_init(|| Vec::with_capacity(1), nearest).collect();
        let mut starts = vec![0; samples.len() + 1];
        for &owner in &owners {
            starts[owner as usize + 1] += 1;
        }
        for sample in 0..samples.len() {
            starts[sample + 1] += starts[sample];
        }
        let mut next = starts.clone();
        let mut members = vec![0; candidates.len()];
        for (candidate, &owner) in owners.iter().enumerate() {
            let place = &mut next[owner as usize];
            members[*place] = candidate as u32;
            *place += 1;
        }
        Ok(Self { members, starts })
    }

    fn of<'a>(
        &self,
        sample: usize,
        candidates: &'a [Candidate],
    ) -> impl Iterator<Item = &'a Candidate> + Clone + use<'a, '_> {
        self.members[self.starts[sample]..self.starts[sample + 1]].iter().map(|&index| &candidates[index as usize])
    }
}

/// Moves each sample, [`ROUNDS`] times, to the point of its part of the surface that is nearest to
/// that part's centroid (Lloyd 1982). Returns the final parts.
///
/// These few rounds keep the samples' density; Lloyd's method would converge only much later.
pub(super) fn relax(
    surface: &MeshSurface<'_>,
    candidates: &[Candidate],
    samples: &mut [Place],
    progress: &dyn Progress,
) -> Result<Cells> {
    progress.begin("spreading samples", ROUNDS as u64);
    for _ in 0..ROUNDS {
        let cells = Cells::new(surface, candidates, samples)?;
        samples.par_iter_mut().enumerate().for_each(|(sample, place)| {
            if let Some(middle) = middle(surface, cells.of(sample, candidates)) {
                *place = middle;
            }
        });
        progress.advance(1);
    }
    progress.end();
    Cells::new(surface, candidates, samples)
}

/// The centroid of some candidates, projected onto the nearest of their triangles. None if there
/// are no candidates.
fn middle<'a>(surface: &MeshSurface<'_>, cell: impl Iterator<Item = &'a Candidate> + Clone) -> Option<Place> {
    let count = cell.clone().count();
    let centroid = cell.clone().map(|candidate| candidate.point(surface)).sum::<DVec3>() / count as f64;
    let mut triangles: Vec<u32> = cell.map(|candidate| candidate.place().triangle).collect();
    triangles.sort_unstable();
    triangles.dedup();
    let places = triangles.into_iter().map(|triangle| {
        let weights = closest_weights(centroid, &surface.triangles[triangle as usize].corners);
        let place = Place { triangle, weights };
        (surface.point(place).distance_squared(centroid), place)
    });
    places.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, place)| place)
}

/// Returns the mean colour of each sample's cell: the surface's colours without details too fine
/// for the samples.
pub(super) fn colors(
    surface: &MeshSurface<'_>,
    candidates: &[Candidate],
    samples: &[Place],
    cells: &Cells,
) -> Vec<[f32; 4]> {
    let color = |(sample, place): (usize, &Place)| {
        let cell = cells.of(sample, candidates);
        if cell.clone().next().is_none() {
            return surface.color(*place);
        }
        mean_color(cell.map(|candidate| (surface.color(candidate.place()), f64::from(candidate.area))))
    };
    samples.par_iter().enumerate().map(color).collect()
}
