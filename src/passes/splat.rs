//! What the twins of [`project`](super::project) and [`footprint`](super::footprint) make: a splat, and where a ray meets it.

use glam::{DVec2, DVec3};

use super::curved::Curve;
use super::facing::Point;
use crate::plan::Sides;
use crate::scene::{Camera, Clip, Fade, Outline};

/// A projected surfel in f64: the twin of [`crate::gpu::layout::Splat`], in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// Which surfel it was.
    pub surfel: u32,
    /// The pixel that the rows are relative to.
    pub anchor: [i64; 2],
    /// First pixel (x, y) that the splat may touch.
    pub first: [u32; 2],
    /// Last pixel.
    pub last: [u32; 2],
    /// `a . (dx, dy, 1)` is u/z (pinhole) or u (orthographic).
    pub a: DVec3,
    /// `b . (dx, dy, 1)` is v/z (pinhole) or v (orthographic).
    pub b: DVec3,
    /// 1/z (pinhole) or z (orthographic).
    pub c: DVec3,
    /// The normal points away from the viewer.
    pub away: bool,
    /// What is seen of the surfels of the view.
    pub sides: Sides,
    /// World space, unit, as light sees the surfel: turned toward the viewer unless the view blends both sides as they are. Of one that
    /// curves that of its centre, as it was given.
    pub normal: DVec3,
    /// The low-pass, if there is one.
    pub filter: Option<Filter>,
    /// Where the disk ends before its rim.
    pub clip: Clip,
    /// The polygon that is drawn of it.
    pub outline: Option<Outline>,
    /// How it curves, in a scene in which some surfel does.
    pub curve: Option<Curve>,
    /// It is a point that faces the camera.
    pub point: Option<Point>,
    /// Surfels that it stands for.
    pub copies: u32,
    /// How much of it there is.
    pub fade: Fade,
}

/// A splat's filter: the twin of [`crate::gpu::layout::Filter`], depths in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    /// The splat's centre relative to its anchor's centre, pixels.
    pub center: DVec2,
    /// The depths on the disk.
    pub depths: [f64; 2],
    /// R: `(r[0] x + r[1] y, r[2] y)`.
    pub r: [f64; 3],
    /// Half the extent of the filter, pixels.
    pub extent: DVec2,
    /// Factor on the kernel's weight.
    pub gain: f64,
}

/// The ray through a pixel's centre meets a splat's plane in front of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection {
    /// Camera-space z, world units.
    pub depth: f64,
    /// Squared radius on the unit disk; the disk ends at 1.
    pub rho2: f64,
    /// How far inside the disk's lines ([`Splat::inside`]); it ends at 0.
    pub inside: f64,
    /// (u, v) on the unit disk; of a fragment of the low-pass that of the disk's centre.
    pub uv: DVec2,
    /// The surfel's back is seen there.
    pub away: bool,
}

impl Splat {
    /// How far inside its lines and its polygon's sides (u, v) lies: negative where it is left out.
    pub fn inside(&self, u: f64, v: f64) -> f64 {
        let of_lines = self.clip.inside(u, v);
        self.outline.map_or(of_lines, |outline| of_lines.min(outline.inside(u, v)))
    }

    /// Whether `at` is of a back, in a view in which pixels show one side of a surface ([`Sides::Nearest`]).
    pub fn shows_back(&self, at: &Intersection) -> bool {
        at.away && self.sides == Sides::Nearest
    }

    /// Whether no pixel shows its front.
    pub fn faces_away(&self) -> bool {
        self.curve.as_ref().map_or(self.away, Curve::faces_away)
    }

    /// The normal that light sees where splats are lit, that of the centre: of a surfel that has a side as it is given.
    pub fn lit_normal(&self) -> DVec3 {
        // That of a disk was turned toward the viewer, that of a cap is turned at each fragment.
        let turned = self.away && self.sides != Sides::Both && self.curve.is_none();
        let turns = self.away && self.sides == Sides::None;
        if turned == turns { self.normal } else { -self.normal }
    }

    /// The normal that light sees at `at`, world space, unit.
    pub fn normal_at(&self, at: &Intersection) -> DVec3 {
        let Some(curve) = &self.curve else { return self.normal };
        let normal = (self.normal + curve.slopes[0] * at.uv.x + curve.slopes[1] * at.uv.y).normalize_or_zero();
        if at.away && self.sides != Sides::Both { -normal } else { normal }
    }
}

impl Intersection {
    /// Inside the disk and its lines, and not nearer than the near depth.
    pub fn hit(&self, camera: &Camera) -> bool {
        self.rho2 <= 1.0 && self.inside >= 0.0 && self.depth >= camera.near
    }
}
