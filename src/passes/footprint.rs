//! A splat at a pixel: coverage, depth and rho. The twin of `wgsl/footprint.wgsl`.

use super::lowpass::filtered;
use super::project::Splat;
use crate::scene::{Camera, LowPass, Projection};

/// The ray through a pixel's centre meets a splat's plane in front of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection {
    /// Camera-space z, world units.
    pub depth: f64,
    /// Squared radius on the unit disk; the disk ends at 1.
    pub rho2: f64,
}

impl Intersection {
    /// Inside the disk and not nearer than the near depth.
    pub fn hit(&self, camera: &Camera) -> bool {
        self.rho2 <= 1.0 && self.depth >= camera.near
    }
}

/// Where the ray through the centre of pixel (x, y) meets the splat's plane, or its low-pass, and the factor on the
/// kernel's weight; `None` behind the camera.
pub fn footprint(splat: &Splat, camera: &Camera, low_pass: LowPass, x: u32, y: u32) -> Option<(Intersection, f64)> {
    let (dx, dy) = ((i64::from(x) - splat.anchor[0]) as f64, (i64::from(y) - splat.anchor[1]) as f64);
    let at = |row: glam::DVec3| row.x * dx + (row.y * dy + row.z);
    let (a, b, c) = (at(splat.a), at(splat.b), at(splat.c));
    let disk = match camera.projection {
        Projection::Pinhole => (c > 0.0).then(|| Intersection { depth: 1.0 / c, rho2: (a * a + b * b) / (c * c) }),
        Projection::Orthographic => Some(Intersection { depth: c, rho2: a * a + b * b }),
    };
    filtered(splat, camera, low_pass, disk, c, (dx, dy))
}
