//! The ellipse that holds a point's Voronoi cell in its tangent plane.

use glam::DVec3;

use crate::surfels::ellipse::Ellipse;
use crate::surfels::gaps::Cell;

/// How many neighbours the distance is the mean of that sizes go by: the first two rings of a square grid.
pub(crate) const RADIUS_NEIGHBOURS: usize = 8;

/// Half-axes are at least so many mean distances long where neighbours are all around.
const LEAST: f64 = 0.6;

/// Where nothing is known on one side, they are at least so many mean distances long: 1.2 spacings on a square grid.
const LEAST_OPEN: f64 = 1.0;

/// A disk reaches past the corners of its cell by this factor, as surfaces are not flat and normals not exact. With 1.25 pictures of the
/// vertices of four models are 0.5 dB better, of 1.4 0.3 dB worse, and 1.5 times and 0.8 times as many pixels show what is hidden.
const PAST_CORNER: f64 = 1.35;

/// Where the cell ends that no neighbour bounds, in distances to the farthest neighbour: a corner beyond is of no gap that they know.
const CELL_REACH: f64 = 1.5;

/// No disk becomes larger than so many mean distances for the sake of its cell. At a ragged boundary corners lie outside of the surface.
const LARGEST: f64 = 1.8;

/// A mean distance is at most this many times that of the neighbours from their own centre, which is a point's own mean distance
/// where points surround it, and stays small for an outlier that sees a far surface.
const LARGEST_LOCAL_RATIO: f64 = 2.0;

/// A mean distance is at least this part of itself for it.
const SMALLEST: f64 = 1e-9;

/// The least radius of a disk beyond which nothing is known on one side, by the offsets of [`RADIUS_NEIGHBOURS`] neighbours, in their
/// unit. Zero without any.
pub(crate) fn open_radius(near: impl Iterator<Item = DVec3>) -> f64 {
    let (sum, count) = near.fold((0.0, 0), |(sum, count), offset| (sum + offset.length(), count + 1));
    LEAST_OPEN * sum / f64::from(count.max(1))
}

/// The half-axes s, the longer one, and t, with s x t along the unit vector `normal`, of the least ellipse that holds the [cell](Cell)
/// of a point in the plane across it. The `offsets` are those of the nearest neighbours, the nearest first, of which there is one;
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
    // Seen from afar, the neighbours of an outlier may all be at one place.
    let mean = mean.min(LARGEST_LOCAL_RATIO * spread).max(SMALLEST * mean);
    let reach = CELL_REACH * offsets.last().map_or(0.0, |farthest| farthest.length());
    let cell = Cell::new(offsets, normal, (reach, LEAST * mean / PAST_CORNER));
    // In mean distances: the squares of areas neither overflow nor underflow.
    let corners = cell.closed().map(|corner| (PAST_CORNER / mean * corner).clamp_length_max(LARGEST));
    let least = if cell.is_closed() { LEAST } else { LEAST_OPEN };
    let [x, y] = cell.basis();
    let ellipse = Ellipse::around_points(&corners.collect::<Vec<_>>(), least);
    ellipse.half_axes().map(|axis| (x * axis.x + y * axis.y) * mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The lengths of the half-axes, and the longer one's direction.
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
        // Stretched by two, the ellipse through the corners of a rectangle of 2 by 1 goes with it.
        let ([s, t], along) = ellipse(grid(2.0, -6..7));
        assert!((s - PAST_CORNER * 2f64.sqrt()).abs() < 1e-9 && along.x.abs() > 1.0 - 1e-9, "{s}");
        assert!(t >= PAST_CORNER * 0.5f64.sqrt() - 1e-9 && t < 0.75 * s, "{t}");
    }

    #[test]
    fn a_border_and_an_outlier_have_disks() {
        let near = |all: &[DVec3]| {
            let mut lengths: Vec<f64> = all.iter().map(|offset| offset.length()).collect();
            lengths.sort_by(f64::total_cmp);
            lengths[..8].iter().sum::<f64>() / 8.0
        };
        // Nothing is known to the left.
        let border = grid(1.0, 0..7);
        let mean = near(&border);
        let ([s, t], _) = ellipse(border.clone());
        assert!(t >= LEAST_OPEN * mean - 1e-9 && s <= LARGEST * mean, "{s} {t} {mean}");
        assert!((open_radius(border.iter().copied().take(0))).abs() < 1e-300);
        // From afar all others are at one place, and how far they lie apart says how large it is.
        let ([s, t], _) = ellipse(vec![DVec3::X * 1e17; 16]);
        assert!(s.is_finite() && t > 0.0 && s < 1e10, "{s} {t}");
        // Fewer neighbours than say something of a cell.
        let ([s, t], _) = ellipse(vec![DVec3::X, DVec3::Y * 2.0]);
        assert!((s - 1.5 * LEAST_OPEN).abs() < 1e-12 && (t - s).abs() < 1e-12);
    }
}
