//! The nearest triangle at a pixel.

use glam::DVec3;

use super::Crossing;

/// The nearest triangle at a pixel, shaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// The triangle's number.
    pub triangle: u32,
    /// The barycentric coordinates.
    pub parts: [f64; 3],
    /// The barycentric area of the pixel.
    pub spread: f64,
    /// Straight linear colour and alpha, lit.
    pub color: [f64; 4],
    /// World space, unit length.
    pub normal: DVec3,
    /// Its depth ([`Camera::depth`](crate::scene::Camera::depth)), world units; +inf where no
    /// triangle is.
    pub depth: f64,
    /// The smallest relative distance to a decision: to an edge, the near depth, or another
    /// triangle's depth.
    pub decision: f64,
}

impl Shown {
    /// No triangle.
    pub const NOTHING: Self = Self {
        triangle: u32::MAX,
        parts: [0.0; 3],
        spread: 0.0,
        color: [0.0; 4],
        normal: DVec3::ZERO,
        depth: f64::INFINITY,
        decision: f64::INFINITY,
    };

    /// The nearest of this and another triangle. At equal depths the greater number is nearest.
    pub(super) fn with(self, triangle: u32, crossing: Crossing) -> Self {
        let decision = self.decision.min(crossing.decision.abs());
        if !crossing.hit {
            return Self { decision, ..self };
        }
        let apart = (self.depth.max(crossing.depth) / self.depth.min(crossing.depth) - 1.0).min(f64::MAX);
        let decision = if self.depth.is_finite() { decision.min(apart) } else { decision };
        let nearer = crossing.depth < self.depth || (crossing.depth == self.depth && triangle > self.triangle);
        match nearer {
            true => {
                let Crossing { parts, spread, depth, .. } = crossing;
                Self { triangle, parts, spread, depth, decision, ..self }
            }
            false => Self { decision, ..self },
        }
    }
}
