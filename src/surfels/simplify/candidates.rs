//! The candidate splats for selection.
//!
//! Wu and Kobbelt grow a candidate from every point. Where splats are large, most of these are
//! nearly the same, and the time to grow all of them increases with the square of their size. Here
//! points are taken in rounds. Each round is spread evenly over the surface, and has as many points
//! as all earlier rounds together. A point that enough splats of earlier rounds cover is skipped.

use rayon::prelude::*;

use super::SplatShape;
use super::cells::Cells;
use super::growing::{Cover, Grower, Splat};
use super::samples::Samples;
use crate::Progress;

/// A point whose cell this many splats cover needs no splat of its own.
pub(super) const ENOUGH: u32 = 48;

/// The least stride between the points of the first round, and the most points of this round. It
/// knows nothing of what is covered yet, and on a plane each of its splats grows over all points.
const FIRST_STRIDE: u32 = 64;
const FIRST_POINTS: u32 = 1024;

/// Splats, and the pieces that each covers.
pub(super) struct Candidates {
    pub splats: Vec<Splat>,
    /// The index of the first cover of each splat, and a final entry: the number of covers.
    first_cover: Vec<u64>,
    covers: Vec<Cover>,
}

impl Candidates {
    /// Grows splats until each cell is covered by [`ENOUGH`] of them or has one of its own, and
    /// each piece is covered.
    pub fn grow(samples: &Samples, cells: &Cells, tolerance: f64, shape: SplatShape, progress: &dyn Progress) -> Self {
        progress.begin("growing splats", samples.len() as u64);
        let mut candidates = Self { splats: Vec::new(), first_cover: vec![0], covers: Vec::new() };
        let mut covered = vec![0u32; samples.len()];
        let count = samples.len() as u32;
        let first_stride = (count / FIRST_POINTS).next_power_of_two().max(FIRST_STRIDE);
        let mut stride = first_stride;
        let mut first = 0;
        loop {
            let round: Vec<u32> = (first..count).step_by(stride as usize).collect();
            progress.advance(round.len() as u64);
            let wanted: Vec<u32> = round.into_iter().filter(|&point| covered[point as usize] < ENOUGH).collect();
            let before = candidates.covers.len();
            candidates.append(&wanted, || Grower::new(samples, cells, tolerance, shape), Grower::grow);
            for cover in &candidates.covers[before..] {
                covered[cover.cell as usize] += u32::from(cover.pieces == cells.pieces(cover.cell));
            }
            if first == 0 && stride == first_stride {
                first = stride / 2;
            } else if stride == 2 {
                break;
            } else {
                stride /= 2;
                first = stride / 2;
            }
        }
        // Some pieces are covered by no splat within the tolerance, because the surface bends by
        // more than that on the way.
        let mut missing: Vec<u16> = (0..count).map(|cell| cells.pieces(cell)).collect();
        for cover in &candidates.covers {
            missing[cover.cell as usize] &= !cover.pieces;
        }
        let bare: Vec<u32> = (0..count).filter(|&cell| missing[cell as usize] != 0).collect();
        candidates.append(&bare, || Grower::new(samples, cells, tolerance, shape), Grower::grow_over_cell);
        progress.end();
        candidates
    }

    /// Grows a splat from each of `points` by `grow`, in parallel.
    fn append<'a>(
        &mut self,
        points: &[u32],
        grower: impl Fn() -> Grower<'a> + Send + Sync,
        grow: impl Fn(&mut Grower<'a>, u32, &mut Vec<Cover>) -> Splat + Sync,
    ) {
        const CHUNK: usize = 256;
        let grown: Vec<(Vec<Splat>, Vec<u64>, Vec<Cover>)> = points
            .par_chunks(CHUNK)
            .map_init(grower, |grower, points| {
                let (mut splats, mut ends, mut covers) = (Vec::new(), Vec::new(), Vec::new());
                for &point in points {
                    splats.push(grow(grower, point, &mut covers));
                    ends.push(covers.len() as u64);
                }
                (splats, ends, covers)
            })
            .collect();
        for (splats, ends, covers) in grown {
            let before = self.covers.len() as u64;
            self.splats.extend(splats);
            self.first_cover.extend(ends.into_iter().map(|end| before + end));
            self.covers.extend(covers);
        }
    }

    /// The pieces that a splat covers, in the order of cells.
    pub fn covers(&self, splat: u32) -> &[Cover] {
        let [first, end] = [splat as usize, splat as usize + 1].map(|i| self.first_cover[i] as usize);
        &self.covers[first..end]
    }

    pub fn cover_count(&self) -> usize {
        self.covers.len()
    }
}
