//! How far points lie apart, without a look at any neighbour: of the cells of a grid that a surface passes through, as many as it has.

use glam::DVec3;
use rayon::prelude::*;

use crate::morton::code;
use crate::random::mixed;
use crate::scene::Bounds;

/// Points that are looked at; more say no more.
const LOOKED_AT: u64 = 1 << 20;

/// Points that a cell holds in the mean, at least: with fewer, cells that the surface passes through are empty.
const HELD: usize = 8;

/// Cells of side 1 that a plane passes through, by its area: the mean of `|n_x| + |n_y| + |n_z|` over all its directions.
const PASSED: f64 = 1.5;

/// Bits of a cell's coordinate.
const BITS: u32 = 21;

/// The square root of the area that a point stands for, in the units of `positions`, most of which lie in `body`: the side of the squares
/// that would tile the surface. None where all lie at one place. It does not depend on the order of the points.
pub(super) fn spacing(positions: &[[f64; 3]], body: &Bounds) -> Option<f64> {
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
        (inside && hash.is_multiple_of(every)).then(|| code(place.to_array().map(|x| (x as u64).min((1 << BITS) - 1))))
    };
    let mut codes: Vec<u64> = positions.par_iter().filter_map(cell).collect();
    codes.par_sort_unstable();
    // From the finest grid on: a cell of the next one has eight of this one's.
    for level in 0..=BITS {
        codes.dedup();
        let passed = codes.len();
        let looked_at = positions.len() as f64 / every as f64;
        if passed as f64 * HELD as f64 <= looked_at || level == BITS || passed <= HELD {
            let side = extent * f64::from(1u32 << level) / cells;
            return Some((passed as f64 * side * side / PASSED / positions.len() as f64).sqrt());
        }
        codes.iter_mut().for_each(|code| *code >>= 3);
    }
    None
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
            // A plane along the axes is the case that the mean over directions errs most for.
            let plane: Vec<[f64; 3]> = (0..count).map(|_| [random.number(), random.number(), 0.0]).collect();
            let found = spacing(&plane, &bounds(&plane)).unwrap_or(0.0) * (count as f64).sqrt();
            assert!((0.7..1.25).contains(&found), "{found}");
        }
        assert_eq!(spacing(&[[1.0; 3]; 4], &Bounds::of([DVec3::ONE; 4].into_par_iter())), None);
    }
}
