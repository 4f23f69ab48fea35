//! The ends of a surface, at which growing splats are clipped.

use glam::DVec3;

/// One line clips a splat at two ends if the cosine of the angle between them exceeds this: 10
/// degrees.
const ONE_LINE: f64 = 0.985;

/// A line in a splat's plane at which the splat will be clipped.
pub(super) struct Ended {
    /// The unit direction from the splat's point to the line.
    pub toward: DVec3,
    /// The distance from the splat's point; the surface ends at the line, or before it.
    pub distance: f64,
    /// The line stands for ends whose corners are at most this far from it.
    pub reach: f64,
}

impl Ended {
    pub fn is_past(&self, offset: DVec3) -> bool {
        offset.dot(self.toward) > self.distance
    }

    /// Whether the line stands for an end with about this unit direction, between two corners.
    pub fn stands_for(&self, toward: DVec3, corners: [DVec3; 2]) -> bool {
        let is_near = |corner: DVec3| (corner.dot(self.toward) - self.distance).abs() <= self.reach;
        self.toward.dot(toward) > ONE_LINE && corners.into_iter().all(is_near)
    }
}
