//! Stores the nearest neighbours of each position.

use rayon::prelude::*;

use super::neighbours::{Neighbour, NeighbourSearch};
use super::positions::DistinctPositions;
use crate::Progress;

/// The number of positions that a thread processes at a time.
const CHUNK: usize = 4096;

/// The nearest neighbours of every position, the nearest first.
pub(crate) struct NeighbourGraph {
    /// The number of neighbours per position: as many as were asked for, or all others if there are
    /// fewer.
    degree: usize,
    neighbours: Vec<u32>,
}

impl NeighbourGraph {
    /// Finds the `count` nearest neighbours of each position.
    pub fn new(distinct: &DistinctPositions, count: usize, progress: &dyn Progress) -> Self {
        progress.begin("finding neighbours", distinct.len() as u64);
        let graph = Self::visit((distinct, count, count), |_| true, &mut vec![(); distinct.len()], progress, |_, _| ());
        progress.end();
        graph
    }

    /// Finds the `count` nearest neighbours of each `wanted` position, calls `make` with them, and
    /// stores the `kept` nearest.
    ///
    /// `values` has one value per position, which is replaced by the result of `make`. Positions
    /// that are not wanted keep their values; their stored neighbours are meaningless.
    pub fn visit<T: Send>(
        (distinct, count, kept): (&DistinctPositions, usize, usize),
        wanted: impl Fn(usize) -> bool + Sync,
        values: &mut [T],
        progress: &dyn Progress,
        make: impl Fn(u32, &[Neighbour]) -> T + Sync,
    ) -> Self {
        let others = distinct.len().saturating_sub(1);
        let degree = kept.min(others);
        let mut neighbours = vec![0; distinct.len() * degree];
        if others == 0 {
            values.iter_mut().filter(|_| wanted(0)).for_each(|value| *value = make(0, &[]));
            return Self { degree, neighbours };
        }
        let search = NeighbourSearch::new(distinct, count.min(others));
        let visit = |(chunk, values, rows): (usize, &mut [T], &mut [u32])| {
            let range = chunk * CHUNK..chunk * CHUNK + values.len();
            if range.clone().any(&wanted) {
                search.of_range(range.clone(), |index, nearest| {
                    let place = index as usize - range.start;
                    if wanted(index as usize) {
                        values[place] = make(index, nearest);
                        rows[place * degree..]
                            .iter_mut()
                            .zip(nearest)
                            .take(degree)
                            .for_each(|(row, near)| *row = near.index);
                    }
                });
            }
            progress.advance(values.len() as u64);
        };
        let chunks = values.par_chunks_mut(CHUNK).enumerate();
        match degree {
            0 => chunks.for_each(|(chunk, values)| visit((chunk, values, &mut []))),
            _ => {
                let rows = neighbours.par_chunks_mut(CHUNK * degree);
                chunks.zip(rows).for_each(|((chunk, values), rows)| visit((chunk, values, rows)));
            }
        }
        Self { degree, neighbours }
    }

    /// The neighbours of position `index`, the nearest first.
    pub fn of(&self, index: u32) -> &[u32] {
        let first = index as usize * self.degree;
        &self.neighbours[first..first + self.degree]
    }

    /// The links from each position to its `count` nearest neighbours, as undirected pairs. Each
    /// pair occurs once, and pairs are ordered by their first position.
    pub fn links(&self, count: usize) -> impl ParallelIterator<Item = (u32, u32)> {
        let near = move |index: u32| &self.of(index)[..count.min(self.degree)];
        let len = self.neighbours.len().checked_div(self.degree).unwrap_or(0);
        (0..len as u32).into_par_iter().flat_map_iter(move |index| {
            near(index)
                .iter()
                .filter(move |&&other| index < other || !near(other).contains(&index))
                .map(move |&other| (index, other))
        })
    }
}
