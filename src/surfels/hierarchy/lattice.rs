//! Positions as whole numbers, whose sums are exact and do not depend on the order.

use glam::DVec3;

use crate::scene::Bounds;
use crate::surfels::{exponent, power_of_two};

/// Bits of a coordinate's magnitude. The sum of 2^32 coordinates fits an i64, and 2^32 times the
/// sum of 2^32 products of two coordinates fits an i128.
pub(super) const BITS: i32 = 30;

/// A grid over a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lattice {
    origin: DVec3,
    /// Grid steps per world unit: a power of two.
    pub steps: f64,
}

impl Lattice {
    /// The finest lattice over `bounds` whose coordinates have magnitudes of at most 2^[`BITS`].
    pub fn over(bounds: &Bounds) -> Self {
        let half = 0.5 * bounds.extent().max_element();
        let steps = if half > 0.0 { power_of_two((BITS - 1 - exponent(half)).min(1000)) } else { 1.0 };
        Self { origin: bounds.center(), steps }
    }

    /// The nearest grid point.
    pub fn place(&self, position: DVec3) -> [i32; 3] {
        let most = f64::from(1 << BITS);
        // Rounding of the box's centre may move a corner past the last step.
        ((position - self.origin) * self.steps).to_array().map(|c| c.round().clamp(-most, most) as i32)
    }

    /// The position of a point that is given in grid steps.
    pub fn position(&self, steps: DVec3) -> DVec3 {
        self.origin + steps / self.steps
    }
}
