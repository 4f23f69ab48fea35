//! Measures the spacing of points without a search for neighbours, from the number of grid cells
//! that their surface passes through.

use glam::DVec3;
use rayon::prelude::*;

use super::estimate::median;
use crate::morton::code;
use crate::random::mixed;
use crate::scene::Bounds;

/// The number of points that are used: more do not improve the result.
const LOOKED_AT: u64 = 1 << 20;

/// The least mean number of points per cell: with fewer, some cells that the surface passes through
/// are empty.
const HELD: usize = 8;

/// The number of unit cells that a plane passes through, per unit area: the mean of
/// `|n_x| + |n_y| + |n_z|` over all directions n.
const PASSED: f64 = 1.5;

/// Bits of a cell coordinate.
const BITS: u32 = 21;

/// With at most this many positions there are too few cells, and the spacing is measured between
/// the positions.
const FEW: usize = HELD * HELD;

/// The square root of the area per position, in the units of `positions`: the side of the squares
/// that would tile the surface.
///
/// `body` is the box of most positions. Points at one position count once. For at most [`FEW`]
/// positions, the result is the median distance to the nearest other one; None if there is only one
/// position. The result does not depend on the order of the points.
pub(super) fn spacing(positions: &[[f64; 3]], body: &Bounds) -> Option<f64> {
    let few = few_distinct(positions);
    if !few.is_empty() {
        return median_nearest(&few);
    }
    let extent = body.extent().max_element();
    if extent <= 0.0 {
        return None;
    }
    let every = (positions.len() as u64).div_ceil(LOOKED_AT).max(1);
    let cells = (1u64 << BITS) as f64;
    let cell = |position: &[f64; 3]| {
        let hash = position.iter().fold(0, |hash, x| mixed(hash ^ x.to_bits()));
        let place = (DVec3::from_array(*position) - body.min) / extent * cells;
        let inside = place.min_element() >= 0.0 && place.max_element() <= cells;
        let code = || code(place.to_array().map(|x| (x as u64).min((1 << BITS) - 1)));
        hash.is_multiple_of(every).then(|| (inside.then(code), hash))
    };
    let mut distinct: Vec<(Option<u64>, u64)> = positions.par_iter().filter_map(cell).collect();
    distinct.par_sort_unstable();
    distinct.dedup();
    let looked_at = distinct.len() as f64;
    let mut codes: Vec<u64> = distinct.into_iter().filter_map(|(code, _)| code).collect();
    // From the finest grid to coarser ones: a cell of the next grid contains eight of this one.
    for level in 0..=BITS {
        codes.dedup();
        let passed = codes.len();
        if passed as f64 * HELD as f64 <= looked_at || level == BITS {
            let side = extent * f64::from(1u32 << level) / cells;
            return (passed > 0).then(|| side * (passed as f64 / PASSED / (looked_at * every as f64)).sqrt());
        }
        codes.iter_mut().for_each(|code| *code >>= 3);
    }
    None
}

/// The distinct `positions`, sorted by their bits, if they are at most [`FEW`]; else empty.
fn few_distinct(positions: &[[f64; 3]]) -> Vec<DVec3> {
    let mut few: Vec<[u64; 3]> = Vec::new();
    for position in positions {
        let bits = position.map(f64::to_bits);
        if let Err(place) = few.binary_search(&bits) {
            if few.len() == FEW {
                return Vec::new();
            }
            few.insert(place, bits);
        }
    }
    few.into_iter().map(|bits| DVec3::from_array(bits.map(f64::from_bits))).collect()
}

/// The median distance from a position to the nearest other one; None for a single position.
fn median_nearest(distinct: &[DVec3]) -> Option<f64> {
    let nearest = |(index, at): (usize, &DVec3)| {
        let others = distinct.iter().enumerate().filter(|(other, _)| *other != index);
        others.map(|(_, other)| length(*other - *at)).min_by(f64::total_cmp)
    };
    median(&mut distinct.iter().enumerate().filter_map(nearest).collect::<Vec<_>>())
}

/// The length of a vector whose squares may underflow.
fn length(vector: DVec3) -> f64 {
    let largest = vector.abs().max_element();
    if largest > 0.0 { (vector / largest).length() * largest } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn the_spacing_of_a_sphere_and_of_a_plane_is_near_what_their_area_says() {
        let mut random = Random::stream(3, 0);
        for count in [2_000usize, 50_000] {
            let sphere: Vec<[f64; 3]> = (0..count)
                .map(|_| {
                    let z = 2.0 * random.number() - 1.0;
                    let (sin, cos) = (std::f64::consts::TAU * random.number()).sin_cos();
                    let r = (1.0 - z * z).sqrt();
                    [r * cos, r * sin, z]
                })
                .collect();
            let truth = (4.0 * std::f64::consts::PI / count as f64).sqrt();
            let bounds = |points: &[[f64; 3]]| Bounds::of(points.par_iter().map(|p| DVec3::from_array(*p)));
            let found = spacing(&sphere, &bounds(&sphere)).unwrap_or(0.0) / truth;
            assert!((0.8..1.25).contains(&found), "{found}");
            let reversed: Vec<_> = sphere.iter().rev().copied().collect();
            assert_eq!(spacing(&reversed, &bounds(&sphere)), spacing(&sphere, &bounds(&sphere)));
            // The mean over all directions has the largest error for a plane along the axes.
            let plane: Vec<[f64; 3]> = (0..count).map(|_| [random.number(), random.number(), 0.0]).collect();
            let found = spacing(&plane, &bounds(&plane)).unwrap_or(0.0) * (count as f64).sqrt();
            assert!((0.7..1.25).contains(&found), "{found}");
        }
        assert_eq!(spacing(&[[1.0; 3]; 4], &Bounds::of([DVec3::ONE; 4].into_par_iter())), None);
    }

    fn of(points: &[[f64; 3]]) -> Option<f64> {
        spacing(points, &Bounds::of(points.par_iter().map(|p| DVec3::from_array(*p))))
    }

    #[test]
    fn a_few_points_have_the_spacing_of_a_few() {
        let mut random = Random::stream(7, 0);
        for count in 2..=200usize {
            for scale in [1e-9, 1.0, 1e9] {
                let points: Vec<[f64; 3]> =
                    (0..count).map(|_| [random.number(), random.number(), 0.0].map(|x| x * scale)).collect();
                let nearest = median_nearest(&points.iter().copied().map(DVec3::from_array).collect::<Vec<_>>());
                let found = of(&points).unwrap_or(0.0) / nearest.unwrap_or(1.0);
                assert!((0.99..3.5).contains(&found), "{count} at {scale}: {found}");
            }
        }
    }

    #[test]
    fn points_at_one_place_are_one() {
        let mut random = Random::stream(8, 0);
        for count in [1usize, 2, 3, 8, 9, 16, 64, 65, 500] {
            let points: Vec<[f64; 3]> =
                (0..count).map(|_| [random.number(), random.number(), random.number()]).collect();
            for copies in [2, 8, 100] {
                let all: Vec<[f64; 3]> = (0..copies).flat_map(|_| points.iter().copied()).collect();
                assert_eq!(of(&all), of(&points), "{count} {copies}");
            }
        }
    }

    #[test]
    fn a_pair_among_a_few_does_not_set_the_spacing() {
        let mut points: Vec<[f64; 3]> = (0..9).map(|i| [f64::from(i % 3), f64::from(i / 3), 0.0]).collect();
        points.push([1e-9, 0.0, 0.0]);
        assert_eq!(of(&points), Some(1.0));
        // Positions on a line at growing distances.
        let line: Vec<[f64; 3]> = (0..65).map(|i| [f64::from(i) * f64::from(i), 0.0, 0.0]).collect();
        assert!(of(&line).is_some_and(|found| (20.0..400.0).contains(&found)), "{:?}", of(&line));
    }
}
