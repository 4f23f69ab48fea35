//! The types that the twins of [`project`](super::project) and [`footprint`](super::footprint)
//! make: a splat, and its intersection with a ray.

use glam::{DVec2, DVec3};

use super::curved::Curve;
use super::facing::Point;
use crate::plan::Sides;
use crate::scene::{Camera, Clip, Fade, Outline};

/// A projected surfel in f64: the twin of [`crate::gpu::layout::Splat`], in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// The index of its surfel.
    pub surfel: u32,
    /// The pixel that the rows a, b and c are relative to.
    pub anchor: [i64; 2],
    /// The first pixel (x, y) that the splat may touch.
    pub first: [u32; 2],
    /// The last pixel (x, y) that it may touch.
    pub last: [u32; 2],
    /// `a . (dx, dy, 1)` is u/z (pinhole) or u (orthographic).
    pub a: DVec3,
    /// `b . (dx, dy, 1)` is v/z (pinhole) or v (orthographic).
    pub b: DVec3,
    /// `c . (dx, dy, 1)` is 1/z (pinhole) or z (orthographic).
    pub c: DVec3,
    /// Whether the normal points away from the viewer.
    pub away: bool,
    /// Which sides of surfels the view shows.
    pub sides: Sides,
    /// The normal that light sees: world space, unit, turned toward the viewer unless the view
    /// blends both sides as they are. For a cap it is that of the centre, as given.
    pub normal: DVec3,
    /// The low-pass, if there is one.
    pub filter: Option<Filter>,
    /// The lines at which the disk ends before its rim.
    pub clip: Clip,
    /// The polygon that is drawn in place of the disk, if any.
    pub outline: Option<Outline>,
    /// The splat's curvature; set for all splats of a scene in which some surfel curves.
    pub curve: Option<Curve>,
    /// The splat's shape, if it is a point that faces the camera.
    pub point: Option<Point>,
    /// The number of equal surfels that are drawn as this splat.
    pub copies: u32,
    /// The cuts of a fading view that contain the splat.
    pub fade: Fade,
}

/// A splat's filter: the twin of [`crate::gpu::layout::Filter`], depths in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    /// The splat's centre relative to its anchor's centre, pixels.
    pub center: DVec2,
    /// The smallest and the largest depth of the disk ([`Camera::depth`]), world units.
    pub depths: [f64; 2],
    /// The rows of R: `R (x, y) = (r[0] x + r[1] y, r[2] y)`.
    pub r: [f64; 3],
    /// Half the extent of the filter, pixels.
    pub extent: DVec2,
    /// The factor on the kernel's weight.
    pub gain: f64,
}

/// The intersection of the ray through a pixel's centre with a splat's plane, in front of the
/// camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection {
    /// Camera-space z, world units.
    pub depth: f64,
    /// The squared radius on the unit disk, which ends at 1.
    pub rho2: f64,
    /// How far inside the disk's clip lines the point lies ([`Splat::inside`]); the disk ends at 0.
    pub inside: f64,
    /// (u, v) on the unit disk; for a fragment of the low-pass (0, 0), the disk's centre.
    pub uv: DVec2,
    /// Whether the surfel's back is seen there.
    pub away: bool,
}

impl Splat {
    /// How far inside its clip lines and its polygon's sides (u, v) lies; negative if outside.
    pub fn inside(&self, u: f64, v: f64) -> f64 {
        let of_lines = self.clip.inside(u, v);
        self.outline.map_or(of_lines, |outline| of_lines.min(outline.inside(u, v)))
    }

    /// Whether `at` shows a back, in a view whose pixels show one side of a surface
    /// ([`Sides::Nearest`]).
    pub fn shows_back(&self, at: &Intersection) -> bool {
        at.away && self.sides == Sides::Nearest
    }

    /// Whether no pixel can show its front.
    pub fn faces_away(&self) -> bool {
        self.curve.as_ref().map_or(self.away, Curve::faces_away)
    }

    /// The normal at the centre that light sees where splats are lit. A normal that has a side
    /// ([`Sides`]) stays as given.
    pub fn lit_normal(&self) -> DVec3 {
        // `normal` of a disk was turned toward the viewer; that of a cap is turned at each
        // fragment.
        let turned = self.away && self.sides != Sides::Both && self.curve.is_none();
        let turns = self.away && self.sides == Sides::None;
        if turned == turns { self.normal } else { -self.normal }
    }

    /// The normal that light sees at `at`: world space, unit.
    pub fn normal_at(&self, at: &Intersection) -> DVec3 {
        let Some(curve) = &self.curve else { return self.normal };
        let normal = (self.normal + curve.slopes[0] * at.uv.x + curve.slopes[1] * at.uv.y).normalize_or_zero();
        if at.away && self.sides != Sides::Both { -normal } else { normal }
    }
}

impl Intersection {
    /// Whether the point is inside the disk and its clip lines, and not nearer than the near depth.
    pub fn hit(&self, camera: &Camera) -> bool {
        self.rho2 <= 1.0 && self.inside >= 0.0 && self.depth >= camera.near
    }
}
