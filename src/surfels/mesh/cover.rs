//! The ellipses of the disks at a triangle's corners, such that the disks cover the triangle, and
//! the lines at which the disks end.

use std::f64::consts::PI;

use glam::{DMat2, DVec2, DVec3};

use super::fans::Fan;
use crate::io::triangles::covering_radius;
use crate::scene::Clip;
use crate::surfels::ellipse::outer;
use crate::surfels::gather::is_usable;

/// A triangle with an area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    /// Unit normal.
    pub normal: DVec3,
    /// Square world units.
    pub area: f64,
    /// The angles at its corners, radians.
    pub angles: [f64; 3],
    /// World coordinates.
    pub corners: [DVec3; 3],
    /// The smallest radius with which disks at the corners cover the triangle, world units.
    radius: f64,
    /// Whether ellipses of the triangle's own shape cover it with less area.
    long: bool,
}

/// Ellipses are used if their area is less than this fraction of the circles' area.
const WORTH: f64 = 0.8;

impl Facet {
    /// The triangle of these vertices; None if it has no area or a vertex has an unusable
    /// coordinate.
    pub fn of(positions: &[[f64; 3]], corners: [u32; 3]) -> Option<Self> {
        let corners = corners.map(|corner| positions[corner as usize]);
        if !corners.iter().all(is_usable) {
            return None;
        }
        let [a, b, c] = corners.map(DVec3::from);
        let double = (b - a).cross(c - a);
        let radius = covering_radius(a, b, c)?;
        let normal = double.try_normalize()?;
        let area = 0.5 * double.length();
        // The ellipse of an equilateral triangle of area A has the area 4 π / (3 √3) A.
        let ellipse = 4.0 * PI / (3.0 * 3f64.sqrt()) * area;
        let angle = |p: DVec3, q: DVec3| p.cross(q).length().atan2(p.dot(q));
        let angles = [angle(b - a, c - a), angle(c - b, a - b), angle(a - c, b - c)];
        Some(Self { normal, area, angles, corners: [a, b, c], radius, long: ellipse < WORTH * PI * radius * radius })
    }
}

impl Facet {
    /// The sides from one of its corners to the two that follow it.
    pub fn sides(&self, place: usize) -> [DVec3; 2] {
        [1, 2].map(|next| self.corners[(place + next) % 3] - self.corners[place])
    }
}

/// Returns the ellipse `q q^T <= S` around a corner of a triangle, as S, such that these ellipses
/// at all corners cover the triangle. The two `sides` go from the corner to the other corners, in
/// the triangle's plane.
///
/// An equilateral triangle is covered by disks of its circumradius at its corners. Any other
/// triangle is an affine image of an equilateral one, and the images of those disks cover it: with
/// corners q_i and their mean m, `S = 2/3 sum (q_i - m)(q_i - m)^T`.
pub(super) fn wanted(facet: &Facet, [p, q]: [DVec2; 2]) -> DMat2 {
    if !facet.long {
        return DMat2::from_diagonal(DVec2::splat(facet.radius * facet.radius));
    }
    let mean = (p + q) / 3.0;
    (outer(mean) + outer(p - mean) + outer(q - mean)) * (2.0 / 3.0)
}

/// A line in a surfel's plane, which keeps `normal . q >= offset`, world units from the surfel's
/// centre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    normal: DVec2,
    offset: f64,
    /// The sine of half the angle to the other line, so that their intersection moves out by no
    /// more than the margin.
    sharp: f64,
}

impl Line {
    /// Returns the clip line of a disk with these half-axes ([`Clip`]), moved out by `margin`.
    pub fn on_disk(&self, major: DVec2, minor: DVec2, margin: f64) -> [f32; 3] {
        Clip::line(self.normal, self.offset - margin * self.sharp, [major, minor])
    }
}

/// Sides that enclose up to this much more than a straight angle, radians, count as a straight
/// line.
const STRAIGHT: f64 = 0.05;

/// Returns the lines at which the surfels of a fan end, at most two for each surfel. No surfel is
/// longer than `reach`. The `sides` go from the vertex to the two other corners of each triangle,
/// in the fan's plane.
pub(super) fn lines(fan: &Fan, sides: &[[DVec2; 2]], reach: f64) -> Vec<Vec<Line>> {
    let mut opposite: Vec<Line> =
        fan.corners.iter().zip(sides).filter(|(corner, _)| corner.ends).filter_map(|(_, side)| across(*side)).collect();
    opposite.retain(|line| -line.offset < reach);
    opposite.sort_by(|a, b| b.offset.total_cmp(&a.offset));
    let (Some([first, _]), Some([_, last])) = (sides.first(), sides.last()) else { return Vec::new() };
    if fan.round {
        opposite.truncate(2);
        return vec![opposite];
    }
    let angle: f64 = sides.iter().map(|[next, last]| next.perp_dot(*last).atan2(next.dot(*last))).sum();
    let sharp = if angle < PI { (0.5 * angle).sin().max(0.0) } else { 1.0 };
    let along = |d: DVec2| Some(Line { normal: d.try_normalize()?, offset: 0.0, sharp });
    let (Some(left), Some(right)) = (along(first.perp()), along(-last.perp())) else { return vec![Vec::new()] };
    if angle > PI + STRAIGHT {
        let beside = |side: Line| [side].into_iter().chain(opposite.iter().copied()).take(2).collect();
        return vec![beside(left), beside(right)];
    }
    vec![vec![left, right]]
}

/// The line through the two corners opposite the vertex.
fn across([p, q]: [DVec2; 2]) -> Option<Line> {
    let normal = (q - p).perp().try_normalize()?;
    // The corners are counter-clockwise, so the vertex is on the left.
    let offset = normal.dot(p);
    (offset < 0.0).then_some(Line { normal, offset, sharp: 1.0 })
}
