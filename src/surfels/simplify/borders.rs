//! The borders of a cell: lines in its tangent plane where other cells begin or the surface ends,
//! and the polygon within them.

use glam::{DVec2, DVec3};

use super::cells::tangent_basis;
use super::samples::{End, Samples};
use crate::surfels::creases::{NARROWEST, SHARP, crease};
use crate::surfels::neighbours::Neighbour;

/// The cosine of the largest elevation of a neighbour over the tangent plane: 60 degrees. A
/// neighbour beyond it lies above or below rather than beside.
const STEEPEST: f64 = 0.5;

/// A crease and a clip line of the surfel are the same end if the cosine between their directions
/// exceeds the first value, and the line is not much farther than the crease. It may be farther by
/// the second value times the crease's distance, plus the third value times the surfel's radius.
const SAME_END: [f64; 3] = [0.9, 0.2, 0.1];

/// Corners of a cell that has no neighbours.
const OUTLINE: usize = 8;

/// A line in the tangent plane at which a cell ends.
pub(super) struct Border {
    /// The unit direction from the cell's point to the line.
    pub toward: DVec2,
    pub distance: f64,
    pub beyond: Beyond,
    /// Whether the border is a crease: two tangent planes meet there.
    crease: bool,
}

/// The neighbour or the end beyond an edge of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Beyond {
    /// A neighbour, and its distance.
    Neighbour(u32, f64),
    /// A sharp edge of the surface, or a seam of its texture: the cell ends, and the graph has no
    /// edge.
    Crease,
    /// A clip line of the surfel.
    Line,
    /// A clip line with a neighbour past it, and the distance of that neighbour: splats grow over a
    /// bend that the tolerance allows.
    Bend(u32, f64),
    /// The outline: nothing is known beyond it.
    Outline,
}

/// The kinds of edges that a growing splat distinguishes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Edge {
    /// The surface continues.
    Joined,
    /// The surface continues past a clip line of the surfel.
    Bend,
    /// The surfel ends at a clip line, which is as exact as the surfel.
    Line,
    /// The surface ends sharply near this edge, which lies where the tangent planes of two points
    /// meet, or halfway across a seam of the texture.
    Crease,
    /// Nothing is known beyond the edge.
    Outline,
}

impl Edge {
    /// Whether there is nothing beyond the edge that a splat could hold.
    pub fn is_end(self) -> bool {
        matches!(self, Self::Line | Self::Crease | Self::Outline)
    }

    /// Whether a splat may be clipped there.
    pub fn is_sharp(self) -> bool {
        matches!(self, Self::Line | Self::Crease | Self::Bend)
    }

    /// Whether the edge is a clip line of the surfel.
    pub fn is_exact(self) -> bool {
        matches!(self, Self::Line | Self::Bend)
    }
}

impl Beyond {
    fn edge(self) -> Edge {
        match self {
            Self::Neighbour(..) => Edge::Joined,
            Self::Crease => Edge::Crease,
            Self::Line => Edge::Line,
            Self::Bend(..) => Edge::Bend,
            Self::Outline => Edge::Outline,
        }
    }

    pub fn neighbour(self) -> Option<(u32, f64)> {
        match self {
            Self::Neighbour(index, distance) | Self::Bend(index, distance) => Some((index, distance)),
            Self::Crease | Self::Line | Self::Outline => None,
        }
    }
}

impl Border {
    /// The border with a neighbour: halfway to it, at half the distance in space, as if the surface
    /// were unrolled into the plane.
    ///
    /// Across a crease, the border is where the two tangent planes meet, however near that is to
    /// one of the points. A border halfway would extend the cell of the nearer point past the
    /// crease, and end the cell of the farther point before the crease.
    ///
    /// None if there is no crease between, and the neighbour lies on another side of the surface,
    /// or above or below the point rather than beside it. Such a neighbour does not bound the cell.
    pub fn new(samples: &Samples, index: u32, neighbour: &Neighbour, tolerance: f64) -> Option<Self> {
        let offset = samples.positions.position(neighbour.index) - samples.positions.position(index);
        let [s, t] = tangent_basis(samples.normals[index as usize]);
        let in_plane = |v: DVec3| DVec2::new(v.dot(s), v.dot(t));
        let distance = neighbour.squared_distance.sqrt();
        let same_side = samples.same_side(index, neighbour.index);
        let cosine = samples.normals[index as usize].dot(samples.normals[neighbour.index as usize]);
        let seam = samples.has_seam(index, neighbour.index);
        let beyond = if seam { Beyond::Crease } else { Beyond::Neighbour(neighbour.index, distance) };
        if let Some((toward, distance)) = crease_between(samples, index, neighbour.index, offset, tolerance) {
            let beyond = if cosine.abs() < SHARP { Beyond::Crease } else { beyond };
            return Some(Self { toward: in_plane(toward), distance, beyond, crease: true });
        }
        let flat = in_plane(offset) / distance;
        let toward = flat.try_normalize().filter(|_| same_side && flat.length() > STEEPEST)?;
        Some(Self { toward, distance: 0.5 * distance, beyond, crease: false })
    }

    /// Whether this clip line of a surfel with this radius marks the same end as `border`, a
    /// crease. If so, and if the neighbour across the crease `is_smooth` with the point, the line
    /// becomes a [`Beyond::Bend`] to that neighbour.
    pub fn stands_for(&mut self, border: &Self, radius: f64, is_smooth: impl Fn(u32) -> bool) -> bool {
        let [along, share, of_radius] = SAME_END;
        let near = self.distance <= border.distance * (1.0 + share) + radius * of_radius;
        let same = border.crease && near && border.toward.dot(self.toward) > along;
        if let (true, Beyond::Line, Beyond::Neighbour(other, distance)) = (same, self.beyond, border.beyond)
            && is_smooth(other)
        {
            self.beyond = Beyond::Bend(other, distance);
        }
        same
    }

    /// The border at a clip line of the surfel of point `index`.
    pub fn of_line(samples: &Samples, index: u32, line: &End) -> Self {
        let [s, t] = tangent_basis(samples.normals[index as usize]);
        let toward = DVec2::new(line.toward.dot(s), line.toward.dot(t)).normalize_or(DVec2::X);
        Self {
            toward,
            distance: line.distance.max(NARROWEST * samples.radii[index as usize]),
            beyond: Beyond::Line,
            crease: false,
        }
    }
}

/// The [`crease`] between a point and another at `offset`, if the surface bends there by more than
/// the tolerance allows.
fn crease_between(samples: &Samples, index: u32, other: u32, offset: DVec3, tolerance: f64) -> Option<(DVec3, f64)> {
    let radius = samples.radii[index as usize].min(samples.radii[other as usize]);
    let [normal, other] = [index, other].map(|point| samples.normals[point as usize]);
    let agrees = samples.oriented || normal.dot(other) >= 0.0;
    crease([normal, if agrees { other } else { -other }], offset, radius, 2.0 * tolerance)
}

/// A convex polygon around the origin, with what lies beyond each of its edges.
#[derive(Default)]
pub(super) struct Polygon {
    pub corners: Vec<DVec2>,
    /// For the edge from the corner of the same index to the next.
    cut_by: Vec<Beyond>,
}

impl Polygon {
    /// Clips the outline, a regular polygon whose edges are `reach` away, by `borders`.
    pub fn cut(reach: f64, borders: &[Border]) -> Self {
        let mut polygon = Self { corners: Vec::with_capacity(12), cut_by: Vec::with_capacity(12) };
        let edge = std::f64::consts::SQRT_2 - 1.0;
        for (x, y) in [(1.0, -edge), (1.0, edge), (edge, 1.0), (-edge, 1.0)] {
            polygon.corners.push(DVec2::new(x, y) * reach);
        }
        for k in 0..OUTLINE / 2 {
            polygon.corners.push(-polygon.corners[k]);
        }
        polygon.cut_by = vec![Beyond::Outline; OUTLINE];
        borders.iter().for_each(|border| polygon.clip(border));
        polygon
    }

    /// Keeps the part on the origin's side of the border.
    fn clip(&mut self, border: &Border) {
        let beyond = |corner: DVec2| corner.dot(border.toward) - border.distance;
        if self.corners.iter().all(|&corner| beyond(corner) <= 0.0) {
            return;
        }
        let count = self.corners.len();
        let (mut corners, mut cut_by) = (Vec::with_capacity(count + 1), Vec::with_capacity(count + 1));
        for k in 0..count {
            let (from, to) = (self.corners[k], self.corners[(k + 1) % count]);
            let (a, b) = (beyond(from), beyond(to));
            let crossing = || from + (to - from) * (a / (a - b));
            if a <= 0.0 {
                corners.push(from);
                cut_by.push(self.cut_by[k]);
                if b > 0.0 {
                    corners.push(crossing());
                    cut_by.push(border.beyond);
                }
            } else if b <= 0.0 {
                corners.push(crossing());
                cut_by.push(self.cut_by[k]);
            }
        }
        *self = Self { corners, cut_by };
    }

    pub fn is_closed(&self) -> bool {
        !self.corners.is_empty() && !self.cut_by.contains(&Beyond::Outline)
    }

    /// The kind of the edge from each corner to the next.
    pub fn edges(&self) -> Vec<Edge> {
        self.cut_by.iter().map(|beyond| beyond.edge()).collect()
    }

    /// The distance of the farthest corner at an edge that [ends](Edge::is_end) the surface; zero
    /// without such edges.
    pub fn farthest_at_end(&self) -> f64 {
        let count = self.corners.len();
        let ends = (0..count).filter(|&k| self.cut_by[k].edge().is_end()).flat_map(|k| [k, (k + 1) % count]);
        ends.map(|k| self.corners[k].length()).fold(0.0, f64::max)
    }

    pub fn neighbours(&self) -> Vec<(u32, f64)> {
        self.cut_by.iter().filter_map(|beyond| beyond.neighbour()).collect()
    }
}
