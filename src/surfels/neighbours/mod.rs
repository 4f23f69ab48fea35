//! Search for the nearest neighbours of positions, with the same result for any order of the
//! points.
//!
//! The search uses a tree of boxes over the Morton order: eight consecutive positions form a leaf,
//! eight consecutive boxes a node. It is built by the sort alone. Coincident, collinear or coplanar
//! positions do no harm (a flat scan is not split across its thickness). The lower bounds of
//! distances to boxes hold in floating point: every operation of [`squared_length`] is monotone, so
//! rounding never makes a box farther than a position inside it. Equal distances are sorted by the
//! order of the positions. The result is thus exactly the first `count` by (distance, order).

mod block;
#[cfg(test)]
mod tests;

use glam::DVec3;
use rayon::prelude::*;

use super::positions::DistinctPositions;

/// Positions in a leaf, and boxes in a node.
const FAN: usize = 8;

/// A neighbour and its distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Neighbour {
    /// Squared distance, scaled units.
    pub squared_distance: f64,
    /// Index among the distinct positions.
    pub index: u32,
}

/// The boxes of [`FAN`] leaves or nodes, stored per coordinate so that eight distances are computed
/// at once. Missing boxes are empty and infinitely far.
#[derive(Clone, Copy)]
struct Node {
    low: [[f64; FAN]; 3],
    high: [[f64; FAN]; 3],
}

impl Node {
    const EMPTY: Self = Self { low: [[f64::INFINITY; FAN]; 3], high: [[f64::NEG_INFINITY; FAN]; 3] };

    /// The bounding boxes of groups of positions.
    fn around<'a>(groups: impl Iterator<Item = &'a [[f64; 3]]>) -> Self {
        let mut node = Self::EMPTY;
        for (child, group) in groups.enumerate().take(FAN) {
            for position in group {
                for (axis, &coordinate) in position.iter().enumerate() {
                    node.low[axis][child] = smaller(node.low[axis][child], coordinate);
                    node.high[axis][child] = larger(node.high[axis][child], coordinate);
                }
            }
        }
        node
    }

    /// The bounding boxes of nodes.
    fn above(nodes: &[Self]) -> Self {
        let mut node = Self::EMPTY;
        for (child, below) in nodes.iter().enumerate().take(FAN) {
            for axis in 0..3 {
                node.low[axis][child] = below.low[axis].into_iter().fold(f64::INFINITY, smaller);
                node.high[axis][child] = below.high[axis].into_iter().fold(f64::NEG_INFINITY, larger);
            }
        }
        node
    }

    /// Squared distances of the boxes from the box between `low` and `high`; zero where they
    /// overlap.
    fn squared_distances(&self, low: &[f64; 3], high: &[f64; 3]) -> [f64; FAN] {
        std::array::from_fn(|child| {
            squared_length(std::array::from_fn(|axis| {
                let (below, above) = (self.low[axis][child] - high[axis], low[axis] - self.high[axis][child]);
                larger(larger(below, above), 0.0)
            }))
        })
    }
}

/// Plain comparisons, as nothing here is NaN and each is one instruction.
fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

fn squared_length([x, y, z]: [f64; 3]) -> f64 {
    x * x + y * y + z * z
}

/// Finds the nearest neighbours in a set of distinct positions.
pub(crate) struct NeighbourSearch<'a> {
    positions: &'a [[f64; 3]],
    /// The levels of the tree, from the nodes over leaves to the root, which is alone in its level.
    levels: Vec<Vec<Node>>,
    /// The number of neighbours that a query returns, if there are as many.
    count: usize,
}

impl<'a> NeighbourSearch<'a> {
    /// Prepares queries for the `count` nearest neighbours.
    pub fn new(distinct: &'a DistinctPositions, count: usize) -> Self {
        let positions = distinct.as_slice();
        let mut level: Vec<Node> =
            positions.par_chunks(FAN * FAN).map(|chunk| Node::around(chunk.chunks(FAN))).collect();
        let mut levels = Vec::new();
        while level.len() > 1 {
            let above = level.par_chunks(FAN).map(Node::above).collect();
            levels.push(std::mem::replace(&mut level, above));
        }
        levels.push(level);
        Self { positions, levels, count }
    }

    /// Fills `found` with the nearest neighbours of position `index`, without itself: the nearest
    /// first, equal distances in the order of [`DistinctPositions`].
    pub fn nearest(&self, index: u32, found: &mut Vec<Neighbour>) {
        found.clear();
        let index = index as usize;
        let query = Query { search: self, index, at: self.positions[index], found, reach: f64::MAX };
        query.go_outward(index);
    }

    /// Fills `found` with the nearest positions to `at`, scaled units, in the same order.
    ///
    /// The search goes outward from position `from`, and is fast if that is near; the result does
    /// not depend on it.
    pub fn nearest_to(&self, at: DVec3, from: u32, found: &mut Vec<Neighbour>) {
        found.clear();
        // No position has this index, so none is excluded.
        let query = Query { search: self, index: usize::MAX, at: at.to_array(), found, reach: f64::MAX };
        query.go_outward(from as usize);
    }
}

struct Query<'a> {
    search: &'a NeighbourSearch<'a>,
    index: usize,
    at: [f64; 3],
    /// The nearest positions so far, sorted.
    found: &'a mut Vec<Neighbour>,
    /// Squared distance beyond which positions are ignored; finite, so an empty box is always
    /// beyond.
    reach: f64,
}

impl Query<'_> {
    /// Searches outward from the leaf of position `from`, where most neighbours are found; most of
    /// the rest of the tree is then out of reach.
    fn go_outward(mut self, from: usize) {
        let mut home = from / FAN;
        self.visit_leaf(home);
        for level in 0..self.search.levels.len() {
            let node = home / FAN;
            self.visit_node(level, node, Some(home % FAN));
            home = node;
        }
    }

    fn visit_leaf(&mut self, leaf: usize) {
        let first = leaf * FAN;
        let end = self.search.positions.len().min(first + FAN);
        for (index, position) in (first..).zip(&self.search.positions[first..end]) {
            let offset = std::array::from_fn(|axis| position[axis] - self.at[axis]);
            let squared_distance = squared_length(offset);
            if squared_distance <= self.reach && index != self.index {
                self.insert(Neighbour { squared_distance, index: index as u32 });
            }
        }
    }

    fn insert(&mut self, new: Neighbour) {
        let before = |n: &Neighbour| (n.squared_distance, n.index) < (new.squared_distance, new.index);
        let place = self.found.iter().rposition(before).map_or(0, |last| last + 1);
        if place >= self.search.count {
            return;
        }
        self.found.truncate(self.search.count - 1);
        self.found.insert(place, new);
        if let Some(last) = self.found.get(self.search.count - 1) {
            self.reach = last.squared_distance;
        }
    }

    /// Visits the children of a node within reach, the nearest first, except child `done`.
    fn visit_node(&mut self, level: usize, node: usize, done: Option<usize>) {
        let distances = self.search.levels[level][node].squared_distances(&self.at, &self.at);
        let mut order = [(0.0, 0); FAN];
        let mut count = 0;
        for (child, distance) in distances.into_iter().enumerate() {
            if distance <= self.reach && done != Some(child) {
                let mut place = count;
                while place > 0 && order[place - 1].0 > distance {
                    order[place] = order[place - 1];
                    place -= 1;
                }
                order[place] = (distance, child);
                count += 1;
            }
        }
        for (distance, child) in order.into_iter().take(count) {
            if distance > self.reach {
                break;
            }
            let child = node * FAN + child;
            match level.checked_sub(1) {
                Some(below) => self.visit_node(below, child, None),
                None => self.visit_leaf(child),
            }
        }
    }
}
