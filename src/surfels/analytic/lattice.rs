//! Fibonacci lattices: evenly spaced points, each computed from its index.
//!
//! The plane lattice (i / n, frac(i / phi)) stays even however it is stretched along its axes,
//! because the golden ratio phi is the number worst approximated by fractions. So any
//! area-preserving map of the unit square spreads it evenly.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3Swizzles};

use super::{SHELLS, TORUS_MAJOR, TORUS_MINOR};

/// 2^64 / phi. The product with an index, modulo 2^64, is the fraction of index / phi. No digit is
/// lost to the integer part, and an index of 1e9 is off by less than 1e-10 turns.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The upper 53 bits as a number in [0, 1).
fn fraction(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// Point `index` of `count` on the unit sphere (Swinbank and Purser 2006, with points at the
/// middles of bands of equal area).
pub(super) fn sphere(index: u64, count: u64) -> DVec3 {
    // 1 - z, so that the polar radius sqrt((1 - z)(1 + z)) loses no digits near the poles.
    let below_pole = (2.0 * index as f64 + 1.0) / count as f64;
    let polar = (below_pole * (2.0 - below_pole)).sqrt();
    let (sin, cos) = (TAU * fraction(index.wrapping_mul(GOLDEN))).sin_cos();
    DVec3::new(polar * cos, polar * sin, 1.0 - below_pole)
}

/// Point `index` of `count` on the shells; each shell has points in proportion to its area.
pub(super) fn shells(index: u64, count: u64) -> DVec3 {
    let area: f64 = SHELLS.iter().map(|radius| radius * radius).sum();
    let (mut up_to, mut first) = (0.0, 0);
    for radius in SHELLS {
        up_to += radius * radius;
        let end = (count as f64 * (up_to / area)).round() as u64;
        if index < end {
            return sphere(index - first, end - first) * radius;
        }
        first = end;
    }
    // Never reached, as the last shell ends with the last point.
    DVec3::NAN
}

/// Point `index` of `count` on the crossing squares; each has half of the points.
pub(super) fn crossing(index: u64, count: u64) -> DVec3 {
    let of_first = count.div_ceil(2);
    match index.checked_sub(of_first) {
        // The golden-ratio coordinate runs across the line where the squares cross. It is never
        // exactly in the middle, so no point lies on that line.
        None => square(index, of_first).yxz(),
        Some(index) => square(index, count - of_first).zxy(),
    }
}

/// Point `index` of `count` on the torus.
///
/// The minor angle v takes equal steps of area: the fraction of the area up to v is (v + e sin v) /
/// tau with e = minor / major. The major angle takes index * m / count turns, where m is the
/// integer nearest to count / phi, so that the lattice closes where v wraps around.
pub(super) fn torus(index: u64, count: u64) -> DVec3 {
    let minor_angle = angle_at_area(TAU * ((index as f64 + 0.5) / count as f64));
    let step = ((u128::from(count) * u128::from(GOLDEN) + (1 << 63)) >> 64) as u64;
    let turn = u128::from(index) * u128::from(step) % u128::from(count);
    let (major_sin, major_cos) = (TAU * (turn as f64 / count as f64)).sin_cos();
    let (minor_sin, minor_cos) = minor_angle.sin_cos();
    let normal = DVec3::new(minor_cos * major_cos, minor_cos * major_sin, minor_sin);
    DVec3::new(TORUS_MAJOR * major_cos, TORUS_MAJOR * major_sin, 0.0) + TORUS_MINOR * normal
}

/// The v in [0, tau] with v + e sin v = `area`.
fn angle_at_area(area: f64) -> f64 {
    const E: f64 = TORUS_MINOR / TORUS_MAJOR;
    // Newton's method in a bracket, which is halved where Newton would leave it.
    let (mut low, mut high) = (0.0, TAU);
    let mut v = area;
    for _ in 0..60 {
        let excess = v + E * v.sin() - area;
        if excess > 0.0 {
            high = v;
        } else {
            low = v;
        }
        let newton = v - excess / (1.0 + E * v.cos());
        let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
        if (next - v).abs() <= 1e-15 * TAU {
            return next;
        }
        v = next;
    }
    v
}

/// Point `index` of `count` on the square [-1, 1] x [-1, 1] at z = 0.
pub(super) fn square(index: u64, count: u64) -> DVec3 {
    let x = (2.0 * index as f64 + 1.0) / count as f64 - 1.0;
    DVec3::new(x, 2.0 * fraction(index.wrapping_mul(GOLDEN)) - 1.0, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_function_is_inverted() {
        for i in 0..=1000 {
            let area = TAU * f64::from(i) / 1000.0;
            let v = angle_at_area(area);
            assert!((v + TORUS_MINOR / TORUS_MAJOR * v.sin() - area).abs() < 4e-15, "{area}");
        }
    }

    #[test]
    fn golden_fractions_are_exact_for_large_indices() {
        // frac(F(k) / phi) is +-phi^-k: F(44) = 701408733.
        let phi = (1.0 + 5f64.sqrt()) / 2.0;
        let near_zero = fraction(701_408_733u64.wrapping_mul(GOLDEN));
        let signed = if near_zero > 0.5 { near_zero - 1.0 } else { near_zero };
        assert!((signed.abs() - phi.powi(-44)).abs() < 1e-10, "{signed}");
    }
}
