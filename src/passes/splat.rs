//! What the twins of [`project`](super::project) and [`footprint`](super::footprint) make: a splat, and where a ray meets it.

use glam::{DVec2, DVec3};

use crate::scene::{Camera, Clip};

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
    /// It is a back in a view in which pixels show one side of a surface ([`Sides::Nearest`](crate::plan::Sides)).
    pub back: bool,
    /// World space, unit, as light sees the surfel: turned toward the viewer unless the view blends both sides as they are.
    pub normal: DVec3,
    /// The low-pass, if there is one.
    pub filter: Option<Filter>,
    /// Where the disk ends before its rim.
    pub clip: Clip,
    /// Surfels that it stands for.
    pub copies: u32,
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
    /// How far inside the disk's lines ([`Clip::inside`]); it ends at 0.
    pub inside: f64,
}

impl Intersection {
    /// Inside the disk and its lines, and not nearer than the near depth.
    pub fn hit(&self, camera: &Camera) -> bool {
        self.rho2 <= 1.0 && self.inside >= 0.0 && self.depth >= camera.near
    }
}
