//! The nearest neighbours of positions, the same for any order of the points.
//!
//! A tree of boxes over the Morton order: eight consecutive positions make a leaf, eight consecutive boxes a node. It
//! needs no construction beyond the sort, has no trouble with coincident, collinear or coplanar positions (a flat scan
//! is not split across its thickness), and its lower bounds hold in floating point: every operation of
//! [`squared_length`] is monotone, so a box is never rounded to be farther than a position inside it. Ties are decided
//! by the order of the positions. The result is thus exactly the first `count` by (distance, order).

use glam::DVec3;
use rayon::prelude::*;

use super::positions::DistinctPositions;

/// Positions in a leaf, and boxes in a node.
const FAN: usize = 8;

/// A neighbour, and how far it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Neighbour {
    /// Squared distance, scaled units.
    pub squared_distance: f64,
    /// Which of the distinct positions.
    pub index: u32,
}

/// The boxes of [`FAN`] leaves or nodes, coordinate by coordinate, so that eight distances are computed at once. Where
/// there are fewer, the box is empty and infinitely far.
#[derive(Clone, Copy)]
struct Node {
    low: [[f64; FAN]; 3],
    high: [[f64; FAN]; 3],
}

impl Node {
    const EMPTY: Self = Self { low: [[f64::INFINITY; FAN]; 3], high: [[f64::NEG_INFINITY; FAN]; 3] };

    /// The boxes around groups of positions.
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

    /// The boxes around nodes.
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

    /// Squared distances of the boxes from `query`; zero inside.
    fn squared_distances(&self, query: &[f64; 3]) -> [f64; FAN] {
        std::array::from_fn(|child| {
            squared_length(std::array::from_fn(|axis| {
                let (below, above) = (self.low[axis][child] - query[axis], query[axis] - self.high[axis][child]);
                larger(larger(below, above), 0.0)
            }))
        })
    }
}

/// Plain comparisons: nothing here is NaN, and these are one instruction each.
fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

fn squared_length([x, y, z]: [f64; 3]) -> f64 {
    x * x + y * y + z * z
}

/// Finds the nearest of a set of distinct positions.
pub(crate) struct NeighbourSearch<'a> {
    positions: &'a [[f64; 3]],
    /// From the nodes over leaves to the root, which is alone in its level.
    levels: Vec<Vec<Node>>,
    /// How many neighbours each query returns, if there are as many.
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

    /// Fills `found` with the nearest neighbours of position `index`, itself excluded, nearest first and equal
    /// distances in the order of [`DistinctPositions`].
    pub fn nearest(&self, index: u32, found: &mut Vec<Neighbour>) {
        self.nearest_within(index, f64::MAX, found);
    }

    /// The same where it is known that all of them are within the squared distance `reach`, scaled units.
    fn nearest_within(&self, index: u32, reach: f64, found: &mut Vec<Neighbour>) {
        found.clear();
        let index = index as usize;
        let mut query = Query { search: self, index, at: self.positions[index], found, reach };
        // From the leaf of the query outward: most neighbours are found at once, and the rest is out of reach.
        let mut home = index / FAN;
        query.visit_leaf(home);
        for level in 0..self.levels.len() {
            let node = home / FAN;
            query.visit_node(level, node, Some(home % FAN));
            home = node;
        }
    }

    /// Fills `found` with the nearest positions to `at`, scaled units, in the same order.
    pub fn nearest_to(&self, at: DVec3, found: &mut Vec<Neighbour>) {
        found.clear();
        // No position has this index, so none is excluded.
        let mut query = Query { search: self, index: usize::MAX, at: at.to_array(), found, reach: f64::MAX };
        query.visit_node(self.levels.len() - 1, 0, None);
    }
}

/// Queries one after the other, of positions that are near each other.
pub(crate) struct Walk<'a> {
    search: &'a NeighbourSearch<'a>,
    last: Option<u32>,
    found: Vec<Neighbour>,
}

impl<'a> Walk<'a> {
    pub fn new(search: &'a NeighbourSearch<'a>) -> Self {
        Self { search, last: None, found: Vec::with_capacity(search.count + 1) }
    }

    /// The nearest neighbours of position `index`, as [`NeighbourSearch::nearest`] finds them.
    ///
    /// A ball of the last position's farthest neighbour, widened by the step from there, holds at least as many others, so
    /// the search need not look beyond it.
    pub fn nearest(&mut self, index: u32) -> &[Neighbour] {
        /// More than the rounding of the few operations below.
        const SLACK: f64 = 1.0 + 1e-12;
        let full = self.found.get(self.search.count.wrapping_sub(1));
        let reach = self.last.zip(full).map_or(f64::MAX, |(last, farthest)| {
            let (from, to) = (self.search.positions[last as usize], self.search.positions[index as usize]);
            let step = squared_length(std::array::from_fn(|axis| to[axis] - from[axis])).sqrt();
            let radius = farthest.squared_distance.sqrt() + step;
            radius * radius * SLACK
        });
        self.search.nearest_within(index, reach, &mut self.found);
        self.last = Some(index);
        &self.found
    }
}

struct Query<'a> {
    search: &'a NeighbourSearch<'a>,
    index: usize,
    at: [f64; 3],
    /// The nearest so far, sorted.
    found: &'a mut Vec<Neighbour>,
    /// Squared distance beyond which nothing is wanted any more; finite, so an empty box is always beyond.
    reach: f64,
}

impl Query<'_> {
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

    /// Visits the children of a node within reach, nearest first, but not `done`.
    fn visit_node(&mut self, level: usize, node: usize, done: Option<usize>) {
        let distances = self.search.levels[level][node].squared_distances(&self.at);
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::Bounds;

    fn distinct(points: &[[f64; 3]]) -> DistinctPositions {
        let bounds = points.iter().fold(Bounds::EMPTY, |b, p| b.with_point(DVec3::from_array(*p)));
        DistinctPositions::new(points, &bounds, DVec3::ZERO).unwrap()
    }

    /// Compares the search with looking at every position, for every `step`-th query.
    fn check(points: &[[f64; 3]], count: usize, step: usize) {
        let distinct = distinct(points);
        for (point, &index) in points.iter().zip(distinct.of_point()) {
            assert_eq!((DVec3::from_array(*point) * distinct.scale()).to_array(), distinct.as_slice()[index as usize]);
        }
        let search = NeighbourSearch::new(&distinct, count);
        let mut walk = Walk::new(&search);
        let (mut found, mut expected) = (Vec::new(), Vec::new());
        for index in (0..distinct.len() as u32).step_by(step) {
            search.nearest(index, &mut found);
            expected.clear();
            expected.extend((0..distinct.len() as u32).filter(|&other| other != index).map(|other| Neighbour {
                squared_distance: distinct.position(index).distance_squared(distinct.position(other)),
                index: other,
            }));
            expected.sort_by(|a, b| a.squared_distance.total_cmp(&b.squared_distance).then(a.index.cmp(&b.index)));
            expected.truncate(count);
            assert_eq!(found, expected, "query {index}");
            assert_eq!(walk.nearest(index), expected, "query {index} after the last");
        }
    }

    /// Numbers in [0, 1) that look random.
    fn noise(seed: u64) -> impl Iterator<Item = f64> {
        let mut state = seed;
        std::iter::repeat_with(move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        })
    }

    fn random(count: usize) -> Vec<[f64; 3]> {
        let mut noise = noise(1);
        (0..count).map(|_| std::array::from_fn(|_| noise.next().unwrap())).collect()
    }

    #[test]
    fn few_points() {
        for count in 0..40 {
            check(&random(count.max(1)), 12, 1);
        }
    }

    #[test]
    fn random_points() {
        check(&random(20_000), 12, 97);
        check(&random(20_000), 1, 97);
    }

    #[test]
    fn coincident_points() {
        check(&vec![[1.0, 2.0, 3.0]; 10_000], 12, 1);
        let two = [[1.0, 2.0, 3.0], [1.0, 2.0, 3.5]];
        check(&(0..10_000).map(|i| two[i % 2]).collect::<Vec<_>>(), 12, 1);
        let mut many = random(100);
        many.extend(vec![[0.5; 3]; 10_000]);
        check(&many, 12, 1);
    }

    #[test]
    fn planes_and_lines() {
        for axis in 0..3 {
            let mut plane = random(100_000);
            plane.iter_mut().for_each(|p| p[axis] = 0.25);
            check(&plane, 12, 4999);
            let mut line = random(50_000);
            line.iter_mut().for_each(|p| *p = std::array::from_fn(|i| if i == axis { p[i] } else { 0.25 }));
            check(&line, 12, 4999);
        }
    }

    #[test]
    fn grids_tie_everywhere() {
        let square: Vec<_> = (0..90_000).map(|i| [(i % 300) as f64, (i / 300) as f64, 7.0]).collect();
        check(&square, 12, 1999);
        let cube: Vec<_> = (0..27_000).map(|i| [(i % 30) as f64, (i / 30 % 30) as f64, (i / 900) as f64]).collect();
        check(&cube, 12, 499);
        check(&cube, 7, 499);
    }

    #[test]
    fn many_at_one_distance() {
        let mut circle: Vec<_> = (0..4_000)
            .map(|i| {
                let (sin, cos) = (i as f64 * 1e-3).sin_cos();
                [cos, sin, 0.0]
            })
            .collect();
        circle.push([0.0; 3]);
        check(&circle, 12, 1);
    }

    #[test]
    fn a_far_outlier() {
        let mut points = random(20_000);
        points.push([1e15, 0.0, 0.0]);
        check(&points, 12, 97);
    }

    #[test]
    fn extreme_sizes() {
        for size in [1e-320, 1e-290, 1e-150, 1e-20, 1e18] {
            let points: Vec<_> = random(500).into_iter().map(|p| p.map(|c| c * size)).collect();
            check(&points, 12, 1);
        }
        let spread: Vec<_> = (0..300).map(|i| [10f64.powi(-i), 0.0, 0.0]).collect();
        let distinct = distinct(&spread);
        let search = NeighbourSearch::new(&distinct, 12);
        let mut found = Vec::new();
        for index in 0..distinct.len() as u32 {
            search.nearest(index, &mut found);
            assert_eq!(found.len(), 12);
            assert!(found.iter().all(|n| n.squared_distance > 0.0));
        }
    }
}
