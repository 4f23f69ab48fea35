//! Estimates the curvature of the surface at a point from the points around it: the caps of
//! surfels.

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::gaps::is_beside;
use super::graph::NeighbourGraph;
use super::positions::DistinctPositions;
use super::sizes::{RADIUS_NEIGHBOURS, offsets};
use crate::scene::Cap;

/// Two points lie on one piece of the surface if the cosine between their normals is larger than
/// this: 60 degrees.
const ONE_PIECE: f64 = 0.5;

/// The least determinant of the normal equations, as a fraction of their trace cubed. Below it, the
/// neighbours lie on a line or on one side and do not determine the curvature in all directions.
/// For neighbours evenly around the point the fraction is 1/27.
const LEAST_SPREAD: f64 = 1e-3;

/// The surface around a position, given by the positions around it and their normals.
pub(crate) struct Around<'a, N: Fn(u32) -> DVec3> {
    pub distinct: &'a DistinctPositions,
    pub graph: &'a NeighbourGraph,
    /// Returns the unit normal at a position.
    pub normal: N,
    /// Whether normals distinguish the two sides of the surface. If they do, neighbours whose
    /// normals point the other way lie on another sheet.
    pub sided: bool,
}

impl<N: Fn(u32) -> DVec3> Around<'_, N> {
    /// The cap of a surfel at a position with the half-axes `axes`, world units.
    pub fn cap(&self, position: u32, axes: [[f32; 3]; 2]) -> Cap {
        let [s, t] = axes.map(|axis| DVec3::from_array(axis.map(f64::from)) * self.distinct.scale());
        let own = s.cross(t);
        let facing = |normal: DVec3| if !self.sided && normal.dot(own) < 0.0 { -normal } else { normal };
        let near = self.graph.of(position).iter().take(RADIUS_NEIGHBOURS);
        let offsets = offsets(self.distinct, self.graph, position, RADIUS_NEIGHBOURS);
        let Cap(heights) = fitted(offsets.zip(near.map(|&other| facing((self.normal)(other)))), [s, t]);
        Cap(heights.map(|height| (f64::from(height) / self.distinct.scale()) as f32))
    }
}

/// Returns the normal at each position; empty if no point has a normal. Among several points'
/// normals at one position, the one with the smallest bits is taken, so that the order of the
/// points has no influence.
pub(crate) fn normals_at(
    distinct: &DistinctPositions,
    given: impl Fn(usize) -> Option<Vec3> + Sync,
) -> Vec<Option<Vec3>> {
    let of_point = distinct.of_point();
    if !(0..of_point.len()).into_par_iter().any(|point| given(point).is_some()) {
        return Vec::new();
    }
    let mut normals: Vec<Option<Vec3>> = vec![None; distinct.len()];
    let bits = |normal: Vec3| normal.to_array().map(f32::to_bits);
    for (point, position) in of_point.iter().enumerate() {
        let at = &mut normals[*position as usize];
        *at = [*at, given(point)].into_iter().flatten().min_by_key(|normal| bits(*normal));
    }
    normals
}

/// Fits the cap of a surfel with the half-axes s and t, whose plane is tangent to the surface, to
/// the offsets and unit normals of up to [`RADIUS_NEIGHBOURS`] neighbours on the surface. All
/// lengths have the same unit.
///
/// A paraboloid is fitted by least squares to the neighbours' heights and slopes, each relative to
/// the distance. The cap is the paraboloid times the fraction of the squares that it explains,
/// because a poor fit would stand out of the surface. The cap is flat if it would be higher than
/// [`Cap::HIGHEST`].
fn fitted(near: impl Iterator<Item = (DVec3, DVec3)>, [s, t]: [DVec3; 2]) -> Cap {
    let normal = s.cross(t).normalize_or_zero();
    let (a, b) = (s / s.length_squared(), t / t.length_squared());
    let near = near.filter(|(offset, other)| is_beside(*offset, normal) && other.dot(normal) > ONE_PIECE);
    // On the unit disk, with heights in units of the longer half-axis, each neighbour gives three
    // equations in the coefficients of uu, uv and vv.
    let unit = s.length().max(t.length());
    let equations = |(offset, other): (DVec3, DVec3)| {
        let (u, v) = (offset.dot(a), offset.dot(b));
        let rise = -other / (other.dot(normal) * unit);
        // For a curvature of 1, the height is half the squared distance, and the slope equals the
        // distance. Heights are divided by the squared distance and slopes by the distance, so
        // heights have a quarter of the weight. They are less certain, because a point does not lie
        // on its own estimated plane.
        let (far, farther) = (u.hypot(v).recip(), (u * u + v * v).recip());
        [
            (DVec3::new(0.5 * u * u, u * v, 0.5 * v * v) * farther, offset.dot(normal) / unit * farther),
            (DVec3::new(u, v, 0.0) * far, rise.dot(s) * far),
            (DVec3::new(0.0, u, v) * far, rise.dot(t) * far),
        ]
    };
    let mut all = [[(DVec3::ZERO, 0.0); 3]; RADIUS_NEIGHBOURS];
    let count = all.iter_mut().zip(near).map(|(slot, near)| *slot = equations(near)).count();
    let all = all[..count].as_flattened();
    let (mut matrix, mut right, mut squares) = (DMat3::ZERO, DVec3::ZERO, 0.0);
    for &(row, value) in all {
        matrix += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
        right += row * value;
        squares += value * value;
    }
    let trace = matrix.x_axis.x + matrix.y_axis.y + matrix.z_axis.z;
    if matrix.determinant() < LEAST_SPREAD * trace.powi(3) {
        return Cap::FLAT;
    }
    let found = matrix.inverse() * right;
    let left = |&(row, value): &(DVec3, f64)| (row.dot(found) - value).powi(2);
    let explained = 1.0 - all.iter().map(left).sum::<f64>() / squares;
    let heights = found * (unit * explained);
    let cap = Cap(heights.as_vec3().to_array());
    if heights.is_finite() && cap.highest() <= Cap::HIGHEST * unit { cap } else { Cap::FLAT }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points around the origin of a paraboloid, with the surface's normals.
    fn near(heights: [f64; 3], count: u32) -> Vec<(DVec3, DVec3)> {
        let [xx, xy, yy] = heights;
        let at = |k: u32| {
            let (sin, cos) = (f64::from(k) * 2.4).sin_cos();
            let (x, y) = ((0.5 + 0.1 * f64::from(k)) * cos, (0.5 + 0.1 * f64::from(k)) * sin);
            let slope = DVec3::new(-(xx * x + xy * y), -(xy * x + yy * y), 1.0);
            (DVec3::new(x, y, 0.5 * (xx * x * x + yy * y * y) + xy * x * y), slope.normalize())
        };
        (0..count).map(at).collect()
    }

    #[test]
    fn the_cap_of_a_paraboloid_is_it() {
        let heights = [-0.4, 0.15, 0.25];
        let (s, t) = (DVec3::new(0.8, 0.3, 0.0), DVec3::new(-0.15, 0.4, 0.0));
        let cap = fitted(near(heights, 8).into_iter(), [s, t]);
        let height = |p: DVec3| 0.5 * (heights[0] * p.x * p.x + heights[2] * p.y * p.y) + heights[1] * p.x * p.y;
        for (u, v) in [(1.0, 0.0), (0.0, 1.0), (0.6, -0.7)] {
            assert!((cap.height(u, v) - height(s * u + t * v)).abs() < 1e-6, "{cap:?}");
        }
    }

    #[test]
    fn what_is_no_paraboloid_stays_flat() {
        let axes = [DVec3::X, DVec3::Y];
        // No neighbours, or too few.
        assert_eq!(fitted([].into_iter(), axes), Cap::FLAT);
        assert_eq!(fitted([(DVec3::X, DVec3::new(-0.1, 0.0, 1.0).normalize())].into_iter(), axes), Cap::FLAT);
        assert_eq!(fitted(near([0.2, 0.1, 0.3], 1).into_iter(), axes), Cap::FLAT);
        // Points close to an oblique line.
        let line =
            |k: i32| (DVec3::new(0.6, 0.8, 0.0) * f64::from(k - 4), DVec3::new(0.0, 1e-3 * f64::from(k % 2), 1.0));
        assert_eq!(fitted((0..8).filter(|k| *k != 4).map(line).collect::<Vec<_>>().into_iter(), axes), Cap::FLAT);
        // A wave: the slopes alternate between up and down.
        let wave = near([0.0; 3], 8).into_iter().enumerate().map(|(k, (offset, _))| {
            (offset, (DVec3::Z + offset.normalize() * if k % 2 == 0 { 0.5 } else { -0.5 }).normalize())
        });
        assert!(fitted(wave.collect::<Vec<_>>().into_iter(), axes).highest() < 0.01);
        // The cap would be higher than a hemisphere.
        assert_eq!(fitted(near([3.0, 0.0, 3.0], 4).into_iter(), axes), Cap::FLAT);
        // Another sheet, whose normals point the other way, has no influence.
        let other = near([0.3, 0.0, 0.3], 8).into_iter().map(|(offset, normal)| (offset, -normal));
        let one = near([0.1, 0.0, 0.1], 8);
        let both: Vec<_> = one.iter().copied().chain(other).collect();
        assert_eq!(fitted(both.into_iter(), axes), fitted(one.into_iter(), axes));
    }
}
