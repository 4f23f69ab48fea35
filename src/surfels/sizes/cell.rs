//! The ellipse that holds a point's Voronoi cell in its tangent plane.

use glam::{DVec2, DVec3};

use crate::surfels::ellipse::Ellipse;
use crate::surfels::gaps::{Cell, MOST_CORNERS, is_beside};

/// The number of neighbours whose mean distance is the unit of sizes: the first two rings of a
/// square grid.
pub(crate) const RADIUS_NEIGHBOURS: usize = 8;

/// The least half-axis of a point with neighbours all around, in mean distances.
pub(crate) const LEAST: f64 = 0.6;

/// The least half-axis of a point without neighbours on one side, in mean distances: 1.2 spacings
/// on a square grid.
const LEAST_OPEN: f64 = 1.0;

/// The least factor by which a disk reaches past the corners of its cell: it applies if all
/// neighbours lie in the disk's plane and none is missing.
const PAST_CORNER: f64 = 1.1;

/// The factor grows by this much times the mean squared sine of the neighbours' elevations over the
/// plane. Where a surface is curved, gaps open between its disks, seen from the side.
const PER_BEND: f64 = 3.0;

/// The factor grows by this times the distance of the farthest corner beyond one mean distance, in
/// mean distances. Where points are random, several neighbouring cells are ragged at once. Beyond
/// 1.5 mean distances, [`LARGEST`] limits the disk.
const PER_GAP: f64 = 0.3;

/// The largest factor. Used everywhere, it would cost 0.4 dB on the vertices of eleven models:
/// disks stand out past outlines.
const MOST_PAST_CORNER: f64 = 1.35;

/// Clip radius of an unbounded cell, in distances to the farthest neighbour. A corner beyond it
/// does not belong to a gap between the neighbours.
const CELL_REACH: f64 = 1.5;

/// A disk's half-axes are enlarged for its cell to at most this many mean distances. At a ragged
/// boundary, corners lie outside the surface.
const LARGEST: f64 = 1.8;

/// A point's mean distance to its neighbours is limited to this many times their mean distance from
/// their centroid. Where points surround the point, both means are about equal. For an outlier
/// beside a far surface, the latter mean stays small.
const LARGEST_LOCAL_RATIO: f64 = 2.0;

/// The limit reduces a mean distance to no less than this fraction of itself.
const SMALLEST: f64 = 1e-9;

/// Returns the least radius of a disk without neighbours on one side, from the offsets of its
/// [`RADIUS_NEIGHBOURS`] nearest neighbours and in their unit. Zero without neighbours.
pub(crate) fn open_radius(near: impl Iterator<Item = DVec3>) -> f64 {
    let (sum, count) = near.fold((0.0, 0), |(sum, count), offset| (sum + offset.length(), count + 1));
    LEAST_OPEN * sum / f64::from(count.max(1))
}

/// Returns the half-axes s, the longer one, and t of the smallest ellipse that holds a point's
/// [cell](Cell) in the plane perpendicular to the unit vector `normal`; s x t is along `normal`.
///
/// The `offsets` are those of the nearest neighbours, at least one, the nearest first. The
/// half-axes are in their unit.
pub(crate) fn cell_ellipse(offsets: &[DVec3], normal: DVec3) -> [DVec3; 2] {
    let near = &offsets[..offsets.len().min(RADIUS_NEIGHBOURS)];
    let count = near.len() as f64;
    let mean = near.iter().map(|o| o.length()).sum::<f64>() / count;
    let disk = |radius: f64| <[DVec3; 2]>::from(normal.any_orthonormal_pair()).map(|axis| axis * radius);
    if near.len() < RADIUS_NEIGHBOURS {
        return disk(LEAST_OPEN * mean);
    }
    let center = near.iter().sum::<DVec3>() / count;
    let spread = near.iter().map(|o| o.distance(center)).sum::<f64>() / count;
    // Seen from an outlier, all neighbours may be at one place.
    let mean = mean.min(LARGEST_LOCAL_RATIO * spread).max(SMALLEST * mean);
    let reach = CELL_REACH * offsets.last().map_or(0.0, |farthest| farthest.length());
    let cell = Cell::new(offsets, normal, (reach, LEAST * mean / MOST_PAST_CORNER));
    let past_corner = past_corner(near, normal, &cell, mean);
    // Corners are in mean distances, so that squares of areas neither overflow nor underflow.
    let mut corners = [DVec2::ZERO; MOST_CORNERS];
    let reached = cell.closed().map(|corner| (past_corner / mean * corner).clamp_length_max(LARGEST));
    let count = corners.iter_mut().zip(reached).map(|(slot, corner)| *slot = corner).count();
    let least = if cell.is_closed() { LEAST } else { LEAST_OPEN };
    let [x, y] = cell.basis();
    let ellipse = Ellipse::around_points(&corners[..count], least);
    ellipse.half_axes().map(|axis| (x * axis.x + y * axis.y) * mean)
}

/// The factor by which a disk reaches past the corners of its `cell`, given the offsets `near` of
/// its neighbours and their mean length `mean`.
fn past_corner(near: &[DVec3], normal: DVec3, cell: &Cell, mean: f64) -> f64 {
    let beside = near.iter().filter(|offset| is_beside(**offset, normal));
    let (sum, count) = beside
        .fold((0.0, 0), |(sum, count), offset| (sum + offset.dot(normal).powi(2) / offset.length_squared(), count + 1));
    let bend = sum / f64::from(count.max(1));
    let farthest = cell.closed().fold(0.0, |farthest: f64, corner| farthest.max(corner.length()));
    let gap = (farthest / mean - 1.0).max(0.0);
    (PAST_CORNER + PER_BEND * bend + PER_GAP * gap).min(MOST_PAST_CORNER)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The lengths of the half-axes, and the direction of the longer one.
    fn ellipse(mut offsets: Vec<DVec3>) -> ([f64; 2], DVec3) {
        offsets.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
        offsets.truncate(16);
        let [s, t] = cell_ellipse(&offsets, DVec3::Z);
        assert!(s.cross(t).normalize().distance(DVec3::Z) < 1e-12);
        ([s, t].map(|axis| axis.length()), s.normalize())
    }

    fn grid(stretch: f64, columns: std::ops::Range<i32>) -> Vec<DVec3> {
        let rows = columns.flat_map(|x| (-6..7).map(move |y| DVec3::new(stretch * f64::from(x), f64::from(y), 0.0)));
        rows.filter(|offset| *offset != DVec3::ZERO).collect()
    }

    #[test]
    fn the_cell_of_a_grid_lies_within() {
        let ([s, t], _) = ellipse(grid(1.0, -6..7));
        assert!((s - PAST_CORNER * 0.5f64.sqrt()).abs() < 1e-9 && (t - s).abs() < 1e-9, "{s} {t}");
        // On a grid stretched by three, the corners of a cell of 3 by 1 are inside, and the
        // half-axes exceed the minimum.
        let ([s, t], along) = ellipse(grid(3.0, -6..7));
        assert!(along.x.abs() > 1.0 - 1e-9 && t < 0.9 * s, "{s} {t}");
        let corner = PAST_CORNER * DVec3::new(1.5 / s, 0.5 / t, 0.0);
        assert!((0.9..1.0 + 1e-9).contains(&corner.length()), "{s} {t} {corner}");
    }

    #[test]
    fn where_the_surface_bends_or_points_are_missing_disks_reach_farther() {
        let flat = ellipse(grid(1.0, -6..7)).0[0];
        let bent = |slope: f64| {
            let fold = |offset: DVec3| DVec3::new(offset.x, offset.y, -slope * offset.x.abs());
            ellipse(grid(1.0, -6..7).into_iter().map(fold).collect()).0[0]
        };
        assert!(bent(0.2) > 1.02 * flat && bent(0.2) < bent(0.4), "{flat} {} {}", bent(0.2), bent(0.4));
        assert!(bent(0.4) <= MOST_PAST_CORNER * 0.5f64.sqrt() + 1e-9, "{}", bent(0.4));
        let missing: Vec<_> =
            grid(1.0, -6..7).into_iter().filter(|o| o.distance(DVec3::new(1.5, 0.5, 0.0)) > 1.0).collect();
        let farthest = DVec3::new(1.5, 0.5, 0.0).length();
        let longer = ellipse(missing).0[0];
        assert!(longer > 1.02 * PAST_CORNER * farthest, "{longer} {farthest}");
        // A second sheet above the plane does not count as curvature.
        let above = grid(1.0, -6..7).into_iter().chain([DVec3::Z * 1.1, DVec3::new(0.3, 0.2, 1.1)]);
        assert!((ellipse(above.collect()).0[0] - flat).abs() < 1e-9);
    }

    #[test]
    fn a_border_and_an_outlier_have_disks() {
        let near = |all: &[DVec3]| {
            let mut lengths: Vec<f64> = all.iter().map(|offset| offset.length()).collect();
            lengths.sort_by(f64::total_cmp);
            lengths[..8].iter().sum::<f64>() / 8.0
        };
        // There are no neighbours on the left.
        let border = grid(1.0, 0..7);
        let mean = near(&border);
        let ([s, t], _) = ellipse(border.clone());
        assert!(t >= LEAST_OPEN * mean - 1e-9 && s <= LARGEST * mean, "{s} {t} {mean}");
        assert!((open_radius(border.iter().copied().take(0))).abs() < 1e-300);
        // Seen from afar all others are at one place, and their spread determines the size.
        let ([s, t], _) = ellipse(vec![DVec3::X * 1e17; 16]);
        assert!(s.is_finite() && t > 0.0 && s < 1e10, "{s} {t}");
        // Too few neighbours for a cell.
        let ([s, t], _) = ellipse(vec![DVec3::X, DVec3::Y * 2.0]);
        assert!((s - 1.5 * LEAST_OPEN).abs() < 1e-12 && (t - s).abs() < 1e-12);
    }
}
