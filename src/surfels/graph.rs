//! Who is whose neighbour: the nearest positions of each position, kept.

use rayon::prelude::*;

use super::neighbours::NeighbourSearch;
use super::positions::DistinctPositions;
use crate::Progress;

/// Positions that one thread takes at a time.
const CHUNK: usize = 4096;

/// The nearest neighbours of every position, the nearest first.
pub(crate) struct NeighbourGraph {
    /// How many neighbours each position has: as many as were asked for, or all others if there are fewer.
    degree: usize,
    neighbours: Vec<u32>,
}

impl NeighbourGraph {
    /// Finds the `count` nearest neighbours of each position.
    pub fn new(distinct: &DistinctPositions, count: usize, progress: &dyn Progress) -> Self {
        let degree = count.min(distinct.len().saturating_sub(1));
        let mut neighbours = vec![0; distinct.len() * degree];
        if degree == 0 {
            return Self { degree, neighbours };
        }
        progress.begin("finding neighbours", distinct.len() as u64);
        let search = NeighbourSearch::new(distinct, degree);
        neighbours.par_chunks_mut(CHUNK * degree).enumerate().for_each(|(chunk, rows)| {
            let first = chunk * CHUNK;
            let positions = rows.len() / degree;
            search.of_range(first..first + positions, |index, nearest| {
                let row = (index as usize - first) * degree;
                for (slot, neighbour) in rows[row..].iter_mut().zip(nearest) {
                    *slot = neighbour.index;
                }
            });
            progress.advance(positions as u64);
        });
        progress.end();
        Self { degree, neighbours }
    }

    /// The neighbours of position `index`, the nearest first.
    pub fn of(&self, index: u32) -> &[u32] {
        let first = index as usize * self.degree;
        &self.neighbours[first..first + self.degree]
    }

    /// The links between positions that are among each other's `count` nearest, from either side, each once and in order.
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
