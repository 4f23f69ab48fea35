//! The distinct positions of a cloud, in an order that does not depend on that of the points.

use std::cmp::Ordering;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use glam::DVec3;
use rayon::prelude::*;

use crate::io::points::retain;
use crate::morton;
use crate::scene::Bounds;
use crate::{Error, Result};

/// Scaled coordinates below 2^-400 become zero, so the squared distance of two distinct positions
/// is never zero.
const SMALLEST: f64 = f64::from_bits((1023 - 400) << 52);

/// The distinct positions of a cloud, ordered along a Morton curve, so that neighbours in space are
/// near each other in memory. The order depends only on the set of positions.
pub(crate) struct DistinctPositions {
    /// Positions relative to the scene's origin, times [`DistinctPositions::scale`].
    positions: Vec<[f64; 3]>,
    /// For each point, the index of its position.
    of_point: Vec<u32>,
    /// The points in the order of their positions.
    in_order: Vec<u32>,
    /// A power of two that scales the scene's extent to about one, so squares neither overflow nor
    /// underflow.
    scale: f64,
}

impl DistinctPositions {
    /// Finds the distinct positions of `points` (world units, finite), which all lie in `bounds`,
    /// relative to `origin`.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] for more than 2^32 - 1 points.
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
        // The scaled extent is below 2, so 61 fractional bits make 62 in all.
        let cell = |p: &[f64; 3]| -> [u64; 3] { std::array::from_fn(|i| ((p[i] - low[i]) * power_of_two(61)) as u64) };
        let mut order: Vec<(u64, u32)> = points
            .par_iter()
            .zip(0..points.len() as u32)
            .map(|(point, index)| (morton_prefix(cell(&place(point))), index))
            .collect();
        // Points that compare equal have the same position, so the sort need not be stable.
        order.par_sort_unstable_by(|a, b| {
            a.0.cmp(&b.0).then_with(|| {
                let (a, b) = (place(&points[a.1 as usize]), place(&points[b.1 as usize]));
                let lexicographic = || a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])).then(a[2].total_cmp(&b[2]));
                morton_order(cell(&a), cell(&b)).then_with(lexicographic)
            })
        });
        let sorted: Vec<[f64; 3]> = order.par_iter().map(|&(_, index)| place(&points[index as usize])).collect();
        let in_order: Vec<u32> = order.into_par_iter().map(|(_, index)| index).collect();
        let mut number = 0;
        let of_place: Vec<u32> = (0..sorted.len())
            .map(|place| {
                number += u32::from(place > 0 && sorted[place] != sorted[place - 1]);
                number
            })
            .collect();
        let of_point = scattered(&in_order, &of_place);
        let mut positions = sorted;
        positions.dedup();
        Ok(Self { positions, of_point, in_order, scale })
    }

    /// Keeps only the positions whose flag in `keep` is set, and the points at them.
    pub fn retain(&mut self, keep: &[bool]) {
        let numbers = |flags: &[bool]| -> Vec<u32> {
            let mut kept = 0;
            let number = |keep: &bool| {
                kept += u32::from(*keep);
                kept - u32::from(*keep)
            };
            flags.iter().map(number).collect()
        };
        let of_position = numbers(keep);
        let keeps: Vec<bool> = self.of_point.par_iter().map(|position| keep[*position as usize]).collect();
        let of_point = numbers(&keeps);
        self.in_order.retain(|point| keeps[*point as usize]);
        self.in_order.par_iter_mut().for_each(|point| *point = of_point[*point as usize]);
        self.of_point.retain(|&position| keep[position as usize]);
        self.of_point.par_iter_mut().for_each(|position| *position = of_position[*position as usize]);
        retain(&mut self.positions, keep);
    }

    /// Calls `make` with each point and its position, and returns the results in the order of the
    /// points.
    ///
    /// The calls are in the order of the positions. Neighbours in space are then near each other in
    /// memory, whatever the order of the points, so `make` reads what it needs several times as
    /// fast.
    pub fn map_points<T: Copy + Send + Sync>(&self, make: impl Fn(u32, u32) -> T + Sync) -> Vec<T> {
        let at = |&point: &u32| make(point, self.of_point[point as usize]);
        let values: Vec<T> = self.in_order.par_iter().map(at).collect();
        if self.positions.len() == self.of_point.len() {
            return self.of_point.par_iter().map(|place| values[*place as usize]).collect();
        }
        let places: Vec<u32> = (0..values.len() as u32).into_par_iter().collect();
        scattered(&self.in_order, &places).into_par_iter().map(|place| values[place as usize]).collect()
    }

    /// The number of distinct positions.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// All positions, scaled units.
    pub fn as_slice(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// The position with this index, scaled units.
    pub fn position(&self, index: u32) -> DVec3 {
        DVec3::from_array(self.positions[index as usize])
    }

    /// The index of the first point at each position.
    pub fn first_points(&self) -> Vec<u32> {
        let mut first = vec![0; self.len()];
        self.of_point().iter().enumerate().rev().for_each(|(point, position)| first[*position as usize] = point as u32);
        first
    }

    /// The index of each point's position.
    pub fn of_point(&self) -> &[u32] {
        &self.of_point
    }

    /// Scaled units per world unit.
    pub fn scale(&self) -> f64 {
        self.scale
    }
}

/// A list with each of `values` at its place in `places`, which are all places of the list.
fn scattered(places: &[u32], values: &[u32]) -> Vec<u32> {
    let list: Vec<AtomicU32> = (0..places.len()).into_par_iter().map(|_| AtomicU32::new(0)).collect();
    places.par_iter().zip(values).for_each(|(place, value)| list[*place as usize].store(*value, Relaxed));
    list.into_par_iter().map(AtomicU32::into_inner).collect()
}

/// The largest e with 2^e <= x, for x > 0; at least -1000.
pub(crate) fn exponent(x: f64) -> i32 {
    (((x.to_bits() >> 52) & 0x7ff) as i32 - 1023).max(-1000)
}

/// 2^e, exactly; e is clamped to the exponents of normal f64 numbers.
pub(crate) fn power_of_two(e: i32) -> f64 {
    f64::from_bits(((e.clamp(-1022, 1023) + 1023) as u64) << 52)
}

/// The interleaved upper 21 of 62 bits of each coordinate.
fn morton_prefix(cell: [u64; 3]) -> u64 {
    morton::code(cell.map(|c| c >> 41))
}

/// Compares the full Morton codes without interleaving: the coordinate with the highest differing
/// bit decides (Chan 2002). This keeps the order on the curve if an outlier puts the rest of the
/// cloud into one cell of the prefix.
fn morton_order(a: [u64; 3], b: [u64; 3]) -> Ordering {
    let mut decisive = 2;
    for axis in [1, 0] {
        let (other, most) = (a[axis] ^ b[axis], a[decisive] ^ b[decisive]);
        // Whether the highest bit of `most` is below that of `other`.
        if most < other && most < (most ^ other) {
            decisive = axis;
        }
    }
    a[decisive].cmp(&b[decisive])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prefix_and_full_order_agree() {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            // With few bits, cells share prefixes.
            (state >> 40 & 7) << 58 | (state >> 50 & 3) << 41
        };
        for _ in 0..10_000 {
            let (a, b) = ([next(), next(), next()], [next(), next(), next()]);
            assert_eq!(morton_prefix(a).cmp(&morton_prefix(b)), morton_order(a, b));
        }
    }

    #[test]
    fn powers_of_two_are_exact() {
        for x in [1e-300f64, 0.3, 1.0, 1.5, 2.0, 1e18] {
            let power = power_of_two(exponent(x));
            assert!(power <= x && x < 2.0 * power);
        }
        assert_eq!(exponent(5e-324), -1000);
    }
}
