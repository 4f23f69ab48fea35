//! Nearest-neighbour search for blocks of consecutive positions.
//!
//! Consecutive positions are usually close in space and share most of their neighbours. One
//! traversal of the tree collects the candidates within a guessed distance of a block of positions,
//! and each position searches that list. If its farthest neighbour is within the guess, the result
//! is exact; otherwise the guess was too short, and the position makes a search of its own.

use std::ops::Range;

use super::{FAN, Neighbour, NeighbourSearch, larger, smaller, squared_length};

/// Positions in a block.
const BLOCK: usize = 16;

/// The largest number of candidates of a block. A block with more is halved, down to searches for
/// single positions. Such a block lies across a jump of the Morton curve, or the guess was made
/// where positions are farther apart.
const MOST_CANDIDATES: usize = 256;

/// The guess is the squared distance of the last block's farthest neighbour, times this.
const WIDER: f64 = 1.2;

/// The state that carries over from block to block.
struct Blocks<'a> {
    search: &'a NeighbourSearch<'a>,
    /// The guess: a squared distance, scaled units.
    reach: f64,
    /// Coordinates of the candidates, the positions within reach of the block, in order.
    candidates: [Vec<f64>; 3],
    indices: Vec<u32>,
    /// Squared distances of the candidates from one position.
    distances: Vec<f64>,
    /// Indices of the candidates within reach of one position.
    near: Vec<u32>,
    /// The nearest neighbours of position `previous`.
    found: Vec<Neighbour>,
    previous: usize,
}

impl NeighbourSearch<'_> {
    /// Calls `take` for each position of `range`, in order, with its nearest neighbours as
    /// [`NeighbourSearch::nearest`] finds them.
    pub fn of_range(&self, range: Range<usize>, mut take: impl FnMut(u32, &[Neighbour])) {
        let mut blocks = Blocks {
            search: self,
            reach: 0.0,
            candidates: [const { Vec::new() }; 3],
            indices: Vec::new(),
            distances: Vec::new(),
            near: Vec::new(),
            found: Vec::with_capacity(self.count + 1),
            previous: 0,
        };
        for first in range.clone().step_by(BLOCK) {
            blocks.take(first..range.end.min(first + BLOCK), &mut take);
        }
    }
}

impl Blocks<'_> {
    fn take(&mut self, block: Range<usize>, take: &mut impl FnMut(u32, &[Neighbour])) {
        if !self.collect(&block) {
            if block.len() > 1 {
                let middle = block.start + block.len() / 2;
                self.take(block.start..middle, take);
                self.take(middle..block.end, take);
            } else {
                self.search_alone(block.start);
                self.reach = self.farthest().map_or(0.0, |farthest| farthest * WIDER);
                take(block.start as u32, &self.found);
            }
            return;
        }
        let mut farthest = 0.0;
        for index in block {
            self.look_through(index);
            if self.farthest().is_none_or(|farthest| farthest > self.reach) {
                self.search_alone(index);
            }
            farthest = larger(farthest, self.farthest().unwrap_or(0.0));
            take(index as u32, &self.found);
        }
        self.reach = farthest * WIDER;
    }

    /// Fills `found` by a search for this position alone.
    fn search_alone(&mut self, index: usize) {
        self.search.nearest(index as u32, &mut self.found);
        self.previous = index;
    }

    /// The squared distance of the last of `found`; None if there are fewer than requested.
    fn farthest(&self) -> Option<f64> {
        self.found.get(self.search.count.wrapping_sub(1)).map(|last| last.squared_distance)
    }

    /// Collects the candidates within reach of the block's bounding box; false if there are too
    /// many.
    fn collect(&mut self, block: &Range<usize>) -> bool {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for position in &self.search.positions[block.clone()] {
            low = std::array::from_fn(|axis| smaller(low[axis], position[axis]));
            high = std::array::from_fn(|axis| larger(high[axis], position[axis]));
        }
        self.candidates.iter_mut().for_each(Vec::clear);
        self.indices.clear();
        self.collect_node(self.search.levels.len() - 1, 0, &low, &high)
    }

    fn collect_node(&mut self, level: usize, node: usize, low: &[f64; 3], high: &[f64; 3]) -> bool {
        let distances = self.search.levels[level][node].squared_distances(low, high);
        for (child, distance) in distances.into_iter().enumerate() {
            if distance > self.reach {
                continue;
            }
            let child = node * FAN + child;
            let fits = match level.checked_sub(1) {
                Some(below) => self.collect_node(below, child, low, high),
                None => self.collect_leaf(child, low, high),
            };
            if !fits {
                return false;
            }
        }
        true
    }

    fn collect_leaf(&mut self, leaf: usize, low: &[f64; 3], high: &[f64; 3]) -> bool {
        let first = leaf * FAN;
        let end = self.search.positions.len().min(first + FAN);
        for (index, position) in (first..).zip(&self.search.positions[first..end]) {
            let outside = |axis: usize| larger(larger(low[axis] - position[axis], position[axis] - high[axis]), 0.0);
            if squared_length(std::array::from_fn(outside)) <= self.reach {
                for (coordinates, coordinate) in self.candidates.iter_mut().zip(position) {
                    coordinates.push(*coordinate);
                }
                self.indices.push(index as u32);
            }
        }
        self.indices.len() <= MOST_CANDIDATES
    }

    /// Fills `found` with the candidates nearest to position `index`, without itself.
    fn look_through(&mut self, index: usize) {
        let at = self.search.positions[index];
        let reach = smaller(self.reach, self.reach_of(index));
        self.previous = index;
        let Self { candidates, indices, distances, near, found, .. } = self;
        let [x, y, z] = &*candidates;
        distances.clear();
        distances.extend(x.iter().zip(y).zip(z).map(|((x, y), z)| squared_length([x - at[0], y - at[1], z - at[2]])));
        // Lists the candidates within reach without a branch, which would be unpredictable.
        near.clear();
        near.resize(distances.len(), 0);
        let mut count = 0;
        for (candidate, distance) in (0..).zip(distances.iter()) {
            near[count] = candidate;
            count += usize::from(*distance <= reach);
        }
        found.clear();
        found.resize(self.search.count, Neighbour { squared_distance: f64::INFINITY, index: u32::MAX });
        let mut kept = 0;
        for &candidate in &near[..count] {
            let new = Neighbour { squared_distance: distances[candidate as usize], index: indices[candidate as usize] };
            if new.index as usize == index {
                continue;
            }
            kept = self.search.count.min(kept + 1);
            // Candidates come in order, so of two at equal distance the later one goes behind. The
            // last entry drops out of a full list.
            let mut place = kept;
            while place > 0 && found[place - 1].squared_distance > new.squared_distance {
                if place < kept {
                    found[place] = found[place - 1];
                }
                place -= 1;
            }
            if place < kept {
                found[place] = new;
            }
        }
        found.truncate(kept);
    }

    /// Returns a squared distance within which position `index` has all its nearest neighbours. The
    /// ball around the previous position, out to its farthest neighbour, contains enough positions.
    /// A ball around position `index` contains them too if its radius is larger by the distance
    /// between both positions.
    fn reach_of(&self, index: usize) -> f64 {
        /// A margin above the rounding error of the few operations below.
        const SLACK: f64 = 1.0 + 1e-12;
        let Some(farthest) = self.farthest() else {
            return f64::INFINITY;
        };
        let (from, to) = (self.search.positions[self.previous], self.search.positions[index]);
        let step = squared_length(std::array::from_fn(|axis| to[axis] - from[axis])).sqrt();
        let radius = farthest.sqrt() + step;
        radius * radius * SLACK
    }
}
