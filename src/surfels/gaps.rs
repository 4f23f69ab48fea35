//! Finds the gaps between points: how far a disk must reach to close them.
//!
//! Randomly placed points leave gaps that are wider than the mean distance of neighbours suggests:
//! in any direction, the next point may be far away. A point's Voronoi cell is the part of the
//! surface that is nearer to it than to any other point, so disks that contain their points' cells
//! leave no hole. The farthest point of a cell is one of its corners, where three points are
//! equally far away: the middle of a gap, or beside one. Where the surface ends, the cell is open
//! and has no such corner, so no disk is enlarged there.

use glam::{DVec2, DVec3};

/// The largest elevation over the tangent plane at which a neighbour is beside a point, as a
/// cosine: 60 degrees.
const STEEPEST: f64 = 0.5;

/// Whether a neighbour at `offset` lies beside a point in its tangent plane, and not above or below
/// it. `normal` is the plane's unit normal.
pub(crate) fn is_beside(offset: DVec3, normal: DVec3) -> bool {
    let squared = offset.length_squared();
    squared - offset.dot(normal).powi(2) > STEEPEST * STEEPEST * squared
}

/// The largest number of corners of a cell; a cell that would exceed it is not cut further.
pub(crate) const MOST_CORNERS: usize = 32;

/// The Voronoi cell of a point in its tangent plane, bounded by its nearest neighbours.
pub(crate) struct Cell {
    corners: [DVec2; MOST_CORNERS],
    count: usize,
    /// One bit per corner: whether a neighbour bounds the edge from it to the next corner, and not
    /// the initial square.
    bounded: u32,
    /// The axes of the plane.
    basis: [DVec3; 2],
}

impl Cell {
    /// Computes the cell of a point in the plane with the unit normal `normal`.
    ///
    /// `offsets` are those of its neighbours, the nearest first. Where no neighbour bounds the
    /// cell, it ends at `reach`, in the unit of the offsets. A cell whose corners are all within
    /// `enough` is not cut further.
    pub fn new(offsets: &[DVec3], normal: DVec3, (reach, enough): (f64, f64)) -> Self {
        let (e1, e2) = normal.any_orthonormal_pair();
        let mut corners = [DVec2::ZERO; MOST_CORNERS];
        for (corner, (x, y)) in corners.iter_mut().zip([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]) {
            *corner = DVec2::new(x, y) * reach;
        }
        let mut cell = Self { corners, count: 4, bounded: 0, basis: [e1, e2] };
        let mut farthest = 2.0 * reach * reach;
        for offset in offsets {
            let (neighbour, squared) = (DVec2::new(offset.dot(e1), offset.dot(e2)), offset.length_squared());
            if squared > 4.0 * farthest || farthest <= enough * enough {
                break;
            }
            if is_beside(*offset, normal) && cell.clip(neighbour) {
                farthest = cell.corners().iter().fold(0.0, |m: f64, corner| m.max(corner.length_squared()));
            }
        }
        cell
    }

    fn corners(&self) -> &[DVec2] {
        &self.corners[..self.count]
    }

    /// Whether a neighbour bounds the edge from corner `k` to the next one.
    fn is_bounded(&self, k: usize) -> bool {
        self.bounded >> k & 1 != 0
    }

    /// Cuts off the part that is nearer to `neighbour` than to the point; returns whether there was
    /// such a part.
    fn clip(&mut self, neighbour: DVec2) -> bool {
        let half = 0.5 * neighbour.length_squared();
        let mut beyond = [0.0; MOST_CORNERS];
        let mut farthest = f64::NEG_INFINITY;
        for (beyond, corner) in beyond.iter_mut().zip(self.corners()) {
            *beyond = corner.dot(neighbour) - half;
            farthest = if *beyond > farthest { *beyond } else { farthest };
        }
        if self.count + 1 >= MOST_CORNERS || farthest <= 0.0 {
            return false;
        }
        let (count, bounded) = (self.count, self.bounded);
        let mut before = [DVec2::ZERO; MOST_CORNERS];
        before[..count].copy_from_slice(self.corners());
        (self.count, self.bounded) = (0, 0);
        for k in 0..count {
            let next = if k + 1 < count { k + 1 } else { 0 };
            let (from, to, a, b) = (before[k], before[next], beyond[k], beyond[next]);
            let crossing = || from + (to - from) * (a / (a - b));
            if a <= 0.0 {
                self.push(from, bounded >> k & 1 != 0);
                if b > 0.0 {
                    self.push(crossing(), true);
                }
            } else if b <= 0.0 {
                self.push(crossing(), bounded >> k & 1 != 0);
            }
        }
        true
    }

    fn push(&mut self, corner: DVec2, bounded: bool) {
        self.corners[self.count] = corner;
        self.bounded |= u32::from(bounded) << self.count;
        self.count += 1;
    }

    /// Whether neighbours bound the cell on all sides.
    pub fn is_closed(&self) -> bool {
        (0..self.count).all(|k| self.is_bounded(k))
    }

    /// The unit vectors x and y of the tangent plane; x × y is its normal.
    pub fn basis(&self) -> [DVec3; 2] {
        self.basis
    }

    /// The corners where the edges of two neighbours meet, as (x, y) in the tangent plane relative
    /// to the point. Corners of the initial square are left out.
    pub fn closed(&self) -> impl Iterator<Item = DVec2> {
        let before = |k: usize| self.is_bounded(if k > 0 { k - 1 } else { self.count - 1 });
        let closed = move |(k, corner): (usize, &DVec2)| (before(k) && self.is_bounded(k)).then_some(*corner);
        self.corners().iter().enumerate().filter_map(closed)
    }

    /// The corners of [`Self::closed`] in space, relative to the point.
    pub fn closed_corners(&self) -> impl Iterator<Item = DVec3> {
        let [e1, e2] = self.basis;
        self.closed().map(move |corner| e1 * corner.x + e2 * corner.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn farthest_corner(cell: &Cell) -> f64 {
        cell.closed().fold(0.0, |m, corner| m.max(corner.length()))
    }

    #[test]
    fn the_cell_of_a_grid_is_a_square_and_a_missing_point_widens_it() {
        let ring = |missing: usize| -> Vec<DVec3> {
            let mut all: Vec<_> = (0..25)
                .filter(|k| *k != 12 && *k != missing)
                .map(|k| DVec3::new((k % 5) as f64 - 2.0, (k / 5) as f64 - 2.0, 0.0))
                .collect();
            all.sort_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
            all
        };
        for normal in [DVec3::Z, -DVec3::Z, DVec3::new(0.1, 0.05, 1.0).normalize()] {
            let whole = farthest_corner(&Cell::new(&ring(12), normal, (3.0, 0.0)));
            assert!((whole - 0.5f64.sqrt()).abs() < 0.02, "{whole}");
            // Without the point at (1, 0), the cell extends to the middle of the gap at (1, 0).
            let wider = farthest_corner(&Cell::new(&ring(13), normal, (3.0, 0.0)));
            assert!((wider - 1.0).abs() < 0.02, "{wider}");
        }
        assert_eq!(Cell::new(&ring(12), DVec3::Z, (3.0, 0.0)).closed_corners().count(), 4);
    }

    #[test]
    fn a_cell_that_is_open_has_no_corner_there() {
        // A straight border, points on a line, and no points.
        let border: Vec<_> =
            [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 0.0)).to_vec();
        let cell = Cell::new(&border, DVec3::Z, (5.0, 0.0));
        assert_eq!(cell.closed_corners().count(), 2);
        assert!(cell.closed_corners().all(|corner| corner.y > 0.0));
        let line: Vec<_> = (1..9).map(|k| DVec3::X * f64::from(k)).collect();
        assert_eq!(farthest_corner(&Cell::new(&line, DVec3::Z, (5.0, 0.0))), 0.0);
        assert_eq!(farthest_corner(&Cell::new(&[], DVec3::Z, (5.0, 0.0))), 0.0);
        // Another sheet directly above and below bounds nothing.
        let sheets = [DVec3::Z * 0.1, -DVec3::Z * 0.1, DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y];
        assert!((farthest_corner(&Cell::new(&sheets, DVec3::Z, (5.0, 0.0))) - 0.5f64.sqrt()).abs() < 1e-12);
    }
}
