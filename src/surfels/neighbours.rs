//! The nearest neighbours of points, the same for any order of the points.

use std::num::NonZero;

use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use crate::scene::Bounds;
use crate::{Error, Result};

/// How many more neighbours are asked for than needed, so that most ties at the last place are seen at once; a
/// full cubic grid has 12 neighbours at the second distance and is settled with this many.
const SPARE: usize = 6;

/// Scaled coordinates below 2^-400 become zero, so that the squared distance of two distinct positions is never zero.
const SMALLEST: f64 = f64::from_bits((1023 - 400) << 52);

/// Relative room for the rounding of squared distances, many times what any order of summing three squares needs.
const SLACK: f64 = 1e-12;

/// The distinct positions of a cloud, in an order that only depends on the set: along a Morton curve, which also makes
/// consecutive queries visit the same parts of the search tree.
pub(crate) struct DistinctPositions {
    /// Positions relative to the scene's origin, times [`DistinctPositions::scale`].
    positions: Vec<[f64; 3]>,
    /// For each point, the index of its position.
    of_point: Vec<u32>,
    /// A power of two that brings the scene's extent to about one, so squares neither overflow nor underflow.
    scale: f64,
}

/// A neighbour, and how far it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Neighbour {
    /// Squared distance, scaled units.
    pub squared_distance: f64,
    /// Which of the distinct positions.
    pub index: u32,
}

impl DistinctPositions {
    /// The distinct ones of `points` (world units, finite), which all lie in `bounds`, relative to `origin`.
    pub fn new(points: &[[f64; 3]], bounds: &Bounds, origin: DVec3) -> Result<Self> {
        if points.len() > u32::MAX as usize {
            return Err(Error::Usage(format!(
                "{} points are more than the {} that normals and radii can be estimated for: split the inputs, or give \
                 both as attributes",
                points.len(),
                u32::MAX
            )));
        }
        let extent = bounds.extent().max_element();
        let scale = if extent > 0.0 { power_of_two(-exponent(extent)) } else { 1.0 };
        let low = ((bounds.min - origin) * scale).to_array();
        let place = |point: &[f64; 3]| -> [f64; 3] {
            let scaled = (DVec3::from_array(*point) - origin) * scale;
            scaled.to_array().map(|c| if c.abs() < SMALLEST { 0.0 } else { c })
        };
        // The scaled extent is below 2, so 20 bits after the point make 21 in all.
        let key = |p: &[f64; 3]| {
            let [x, y, z]: [u64; 3] = std::array::from_fn(|i| spread_bits(((p[i] - low[i]) * 1048576.0) as u64));
            x | y << 1 | z << 2
        };
        let mut order: Vec<(u64, u32)> =
            points.par_iter().zip(0..points.len() as u32).map(|(point, index)| (key(&place(point)), index)).collect();
        // Points that compare equal are the same position, so it does not matter that this sort is not stable.
        order.par_sort_unstable_by(|a, b| {
            a.0.cmp(&b.0).then_with(|| {
                let (a, b) = (place(&points[a.1 as usize]), place(&points[b.1 as usize]));
                a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2]))
            })
        });
        let mut positions: Vec<[f64; 3]> = Vec::with_capacity(points.len());
        let mut of_point = vec![0; points.len()];
        for &(_, index) in &order {
            let position = place(&points[index as usize]);
            if positions.last() != Some(&position) {
                positions.push(position);
            }
            of_point[index as usize] = (positions.len() - 1) as u32;
        }
        Ok(Self { positions, of_point, scale })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Position `index`, scaled units.
    pub fn position(&self, index: u32) -> DVec3 {
        DVec3::from_array(self.positions[index as usize])
    }

    /// For each point that was given, which position it has.
    pub fn of_point(&self) -> &[u32] {
        &self.of_point
    }

    /// Scaled units per world unit.
    pub fn scale(&self) -> f64 {
        self.scale
    }
}

/// Finds the nearest of a set of distinct positions.
pub(crate) struct NeighbourSearch<'a> {
    distinct: &'a DistinctPositions,
    /// None for so few positions that looking at all of them is the search.
    tree: Option<ImmutableKdTree<f64, 3>>,
    /// How many neighbours each query returns, if there are as many.
    count: usize,
}

impl<'a> NeighbourSearch<'a> {
    /// Prepares queries for the `count` nearest neighbours.
    pub fn new(distinct: &'a DistinctPositions, count: usize) -> Result<Self> {
        let tree = if distinct.len() > count + 1 + SPARE {
            let built = ImmutableKdTree::new_from_slice_parallel(&distinct.positions);
            Some(built.map_err(|e| Error::Usage(format!("no search tree can be built over the points: {e}")))?)
        } else {
            None
        };
        Ok(Self { distinct, tree, count })
    }

    /// Fills `found` with the nearest neighbours of position `index`, itself excluded, nearest first and equal
    /// distances in the order of [`DistinctPositions`].
    ///
    /// Which of several equally far candidates a search tree returns depends on how it was built. So a result whose
    /// last place is contested is searched again by radius: every candidate at that distance is then seen, and the
    /// total order above decides.
    pub fn nearest(&self, index: u32, found: &mut Vec<Neighbour>) {
        let distinct = self.distinct;
        let query = distinct.position(index);
        let neighbour =
            |other: u32| Neighbour { squared_distance: query.distance_squared(distinct.position(other)), index: other };
        found.clear();
        let Some(tree) = &self.tree else {
            found.extend((0..distinct.len() as u32).filter(|&other| other != index).map(neighbour));
            return keep_nearest(found, self.count);
        };
        let wanted = NonZero::<usize>::MIN.saturating_add(self.count + SPARE);
        let candidates = tree.query(&query.to_array()).nearest_n::<SquaredEuclidean<f64>>(wanted).execute();
        found.extend(candidates.iter().filter(|c| c.item != index).map(|c| neighbour(c.item)));
        sort(found);
        let reach = found.last().map_or(0.0, |n| n.squared_distance);
        let last = found.get(self.count.wrapping_sub(1)).map_or(f64::MAX, |n| n.squared_distance) * (1.0 + SLACK);
        if reach <= last {
            let candidates = tree.query(&query.to_array()).within::<SquaredEuclidean<f64>>(last).unsorted().execute();
            found.clear();
            found.extend(candidates.iter().filter(|c| c.item != index).map(|c| neighbour(c.item)));
        }
        keep_nearest(found, self.count);
    }
}

fn sort(found: &mut [Neighbour]) {
    found.sort_unstable_by(|a, b| a.squared_distance.total_cmp(&b.squared_distance).then(a.index.cmp(&b.index)));
}

fn keep_nearest(found: &mut Vec<Neighbour>, count: usize) {
    sort(found);
    found.truncate(count);
}

/// The largest e with 2^e <= x, for x > 0; at least -1000.
pub(crate) fn exponent(x: f64) -> i32 {
    (((x.to_bits() >> 52) & 0x7ff) as i32 - 1023).max(-1000)
}

/// 2^e, exactly; e is limited to what a normal f64 holds.
pub(crate) fn power_of_two(e: i32) -> f64 {
    f64::from_bits(((e.clamp(-1022, 1023) + 1023) as u64) << 52)
}

/// Puts two zeros before each of the lower 21 bits.
fn spread_bits(x: u64) -> u64 {
    let mut x = x.min(0x1f_ffff);
    x = (x | x << 32) & 0x1f_0000_0000_ffff;
    x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn distinct(points: &[[f64; 3]]) -> DistinctPositions {
        let bounds = points.iter().fold(Bounds::EMPTY, |b, p| b.with_point(DVec3::from_array(*p)));
        DistinctPositions::new(points, &bounds, DVec3::ZERO).unwrap()
    }

    /// Compares the search with looking at every position, for every `step`-th query.
    fn check(points: &[[f64; 3]], count: usize, step: usize) {
        let distinct = distinct(points);
        for (point, &index) in points.iter().zip(distinct.of_point()) {
            assert_eq!((DVec3::from_array(*point) * distinct.scale()).to_array(), distinct.positions[index as usize]);
        }
        let search = NeighbourSearch::new(&distinct, count).unwrap();
        let (mut found, mut expected) = (Vec::new(), Vec::new());
        for index in (0..distinct.len() as u32).step_by(step) {
            search.nearest(index, &mut found);
            expected.clear();
            expected.extend((0..distinct.len() as u32).filter(|&other| other != index).map(|other| Neighbour {
                squared_distance: distinct.position(index).distance_squared(distinct.position(other)),
                index: other,
            }));
            keep_nearest(&mut expected, count);
            assert_eq!(found, expected, "query {index}");
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
    fn extreme_sizes() {
        for size in [1e-320, 1e-290, 1e-150, 1e-20, 1e18] {
            let points: Vec<_> = random(500).into_iter().map(|p| p.map(|c| c * size)).collect();
            check(&points, 12, 1);
        }
        let spread: Vec<_> = (0..300).map(|i| [10f64.powi(-i), 0.0, 0.0]).collect();
        let distinct = distinct(&spread);
        let search = NeighbourSearch::new(&distinct, 12).unwrap();
        let mut found = Vec::new();
        for index in 0..distinct.len() as u32 {
            search.nearest(index, &mut found);
            assert_eq!(found.len(), 12);
            assert!(found.iter().all(|n| n.squared_distance > 0.0));
        }
    }
}
