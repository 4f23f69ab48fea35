//! Fits planes to the neighbours of several positions at once.

use glam::DVec3;

use super::eigen::{Eigen, Symmetric3, eigen_of};
use super::estimate::NORMAL_NEIGHBOURS;
use super::graph::NeighbourGraph;
use super::positions::DistinctPositions;
use super::sizes::offsets;

/// The number of positions whose planes are fitted at once: with fewer, the processor waits for
/// roots and quotients.
pub(crate) const TOGETHER: usize = 4;

/// A coordinate of one point of each neighbourhood.
type Lanes<const LANES: usize> = [f64; LANES];

/// The offsets of neighbours from their positions, for several positions with equally many.
pub(crate) struct Neighbourhoods<const LANES: usize> {
    /// The offsets, scaled units. The first one is zero: it is the position itself.
    offsets: [[DVec3; NORMAL_NEIGHBOURS + 1]; LANES],
    /// The number of offsets of each position.
    count: usize,
}

impl<const LANES: usize> Neighbourhoods<LANES> {
    /// The neighbourhoods of the positions with these indices.
    pub fn around((distinct, graph): (&DistinctPositions, &NeighbourGraph), indices: [u32; LANES]) -> Self {
        let mut all = Self { offsets: [[DVec3::ZERO; NORMAL_NEIGHBOURS + 1]; LANES], count: 1 };
        for (slots, index) in all.offsets.iter_mut().zip(indices) {
            let offsets = offsets(distinct, graph, index, NORMAL_NEIGHBOURS);
            all.count = 1 + slots[1..].iter_mut().zip(offsets).map(|(slot, offset)| *slot = offset).count();
        }
        all
    }

    /// The offsets of the neighbours of one of the positions, the nearest first.
    pub fn of_neighbours(&self, lane: usize) -> &[DVec3] {
        &self.offsets[lane][1..self.count]
    }

    /// The directions in which the offsets vary least, in the half-space of the unit vector `up`.
    ///
    /// For offsets on a line it is the direction perpendicular to the line that is nearest to `up`;
    /// if all are equal, it is `up`.
    pub fn normals(&self, up: DVec3) -> [DVec3; LANES] {
        let (scatters, sizes) = self.scatters();
        let eigen = eigen_of(scatters);
        std::array::from_fn(|lane| if sizes[lane] == 0.0 { up } else { of_least(&eigen[lane], up) })
    }

    /// The sums of squares around the means, in units of the largest coordinates, which come
    /// second.
    fn scatters(&self) -> ([Symmetric3; LANES], Lanes<LANES>) {
        let mut offsets = [[[0.0; LANES]; 3]; NORMAL_NEIGHBOURS + 1];
        for (lane, own) in self.offsets.iter().enumerate() {
            for (joined, offset) in offsets.iter_mut().zip(own) {
                [joined[0][lane], joined[1][lane], joined[2][lane]] = offset.to_array();
            }
        }
        let offsets = &mut offsets[..self.count];
        let mut largest = [0.0; LANES];
        for coordinates in offsets.as_flattened() {
            for lane in 0..LANES {
                let size = coordinates[lane].abs();
                largest[lane] = if size > largest[lane] { size } else { largest[lane] };
            }
        }
        // Offsets are scaled to about 1, so the squares below are equally exact in dense and sparse
        // parts.
        let mut mean = [[0.0; LANES]; 3];
        for offset in offsets.iter_mut() {
            for axis in 0..3 {
                for lane in 0..LANES {
                    offset[axis][lane] /= largest[lane];
                    mean[axis][lane] += offset[axis][lane];
                }
            }
        }
        mean.as_flattened_mut().iter_mut().for_each(|sum| *sum /= self.count as f64);
        let mut sums = [[0.0; LANES]; 6];
        for offset in offsets.iter() {
            for lane in 0..LANES {
                let [x, y, z] = [0, 1, 2].map(|axis| offset[axis][lane] - mean[axis][lane]);
                let squares = [x * x, y * y, z * z, x * y, x * z, y * z];
                sums.iter_mut().zip(squares).for_each(|(sum, square)| sum[lane] += square);
            }
        }
        let of_lane = |lane: usize| {
            let [xx, yy, zz, xy, xz, yz] = sums.map(|sum| sum[lane]);
            Symmetric3 { xx, yy, zz, xy, xz, yz }
        };
        (std::array::from_fn(of_lane), largest)
    }
}

/// The direction in which the offsets vary least, in the half-space of the unit vector `up`; there
/// is one for each of up to [`NORMAL_NEIGHBOURS`] neighbours, and the position's own, which is zero.
pub(crate) fn fitted_normal(offsets: &[DVec3], up: DVec3) -> DVec3 {
    let mut alone = Neighbourhoods { offsets: [[DVec3::ZERO; NORMAL_NEIGHBOURS + 1]], count: offsets.len() };
    alone.offsets[0][..offsets.len()].copy_from_slice(offsets);
    let [normal] = alone.normals(up);
    normal
}

/// The direction of least variance, in the half-space of `up`.
fn of_least(eigen: &Eigen, up: DVec3) -> DVec3 {
    let across_line = |line: DVec3| {
        // Up comes first; the other axes serve a line along up.
        let candidates = [up, DVec3::X, DVec3::Y].map(|axis| axis - line * axis.dot(line));
        candidates.into_iter().find(|c| c.length_squared() > 1e-12).map_or(up, DVec3::normalize)
    };
    // A width of a millionth of the length is only the rounding of the coordinates.
    let is_line = eigen.values[1] <= 1e-12 * eigen.values[2];
    let normal = if is_line { across_line(eigen.vector(2)) } else { eigen.vector(0) };
    let side = normal.dot(up);
    let flip =
        side < 0.0 || (side == 0.0 && normal.to_array().into_iter().find(|c| *c != 0.0).is_some_and(|c| c < 0.0));
    if flip { -normal } else { normal }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn degenerate_neighbourhoods_have_a_normal() {
        let up = DVec3::Z;
        assert_eq!(fitted_normal(&[DVec3::ZERO; 5], up), up);
        for size in [1e-150, 1.0, 1e150] {
            let line: Vec<_> = (0..13).map(|i| DVec3::new(i as f64, 0.0, i as f64) * size).collect();
            let normal = fitted_normal(&line, up);
            assert!(normal.distance(DVec3::new(-1.0, 0.0, 1.0).normalize()) < 1e-12, "{normal}");
            let upright: Vec<_> = (0..13).map(|i| DVec3::new(0.0, 0.0, i as f64) * size).collect();
            assert!(fitted_normal(&upright, up).distance(DVec3::X) < 1e-12);
            let wall: Vec<_> = (0..13).map(|i| DVec3::new(0.0, (i % 4) as f64, (i / 4) as f64) * size).collect();
            assert!(fitted_normal(&wall, up).distance(DVec3::X) < 1e-12);
        }
    }

    #[test]
    fn planes_fitted_together_are_those_fitted_alone() {
        let mut random = Random::stream(5, 0);
        let mut number = || 2.0 * random.number() - 1.0;
        for round in 0..2000 {
            // Some neighbourhoods lie on a line, in a plane along the axes, or at one place.
            let flat = |k: usize, size: f64| if round % (k + 2) == 0 { 0.0 } else { size };
            let offsets: [[DVec3; NORMAL_NEIGHBOURS + 1]; TOGETHER] = std::array::from_fn(|lane| {
                let sizes = [flat(lane, 1.0), flat(2 * lane + 1, 1e-3), flat(3 * lane + 2, 1e-7)];
                std::array::from_fn(|k| if k == 0 { DVec3::ZERO } else { sizes.map(|size| size * number()).into() })
            });
            let together = Neighbourhoods { offsets, count: NORMAL_NEIGHBOURS + 1 }.normals(DVec3::Z);
            assert_eq!(together, offsets.each_ref().map(|own| fitted_normal(own, DVec3::Z)));
        }
    }
}
