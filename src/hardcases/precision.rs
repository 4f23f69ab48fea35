//! Bounds how far a fragment of the device may lie from its f64 twin.
//!
//! The bounds follow, to first order, from the operations of `wgsl/common/camera_*.wgsl`,
//! `wgsl/accumulate/rows.wgsl` and `wgsl/project/footprint.wgsl`. With e = 2^-24 (half a unit in
//! the last place of 1), camera-space p, s, t, and `cosine = |p . (s x t)| / (|p| |s| |t|)` (for an
//! orthographic camera `|(s x t).z| / (|s| |t|)`):
//!
//! - s and t are rotated by three products of rounded factors each, with an error of at most 6e of
//!   their length. The rows `t x p`, `p x s`, `s x t` then err by 10e, 10e and 15e of the product
//!   of their factors' lengths.
//! - The determinant by which all rows are divided sums some twenty roundings of size
//!   `e |p||s||t| / sqrt(3)`. The root of the sum of their squares is 2.6e; 6e is allowed. The rows
//!   as a whole then have a relative error of 6e / cosine.
//! - Rows are relative to the splat's own pixel, so the coefficients of x and y act on the distance
//!   from the splat's centre, in pixels. The centre is computed in doubled precision (2^-42 of the
//!   image coordinate) and, unless the splat is thin, stored to 5e of a pixel.
//! - Thin splats (aspect over 8) have rows a and b in doubled precision (2^-42). They are stored to
//!   36 bits (row a), and to 24 bits of the much smaller changes along the long axis (row b).
//! - Evaluation on the device adds 4e of the sum of the terms' magnitudes (three roundings), and a
//!   division.
//!
//! rho changes by no more than the vector (u, v). For a pinhole, a relative error of the depth is
//! also a relative error of rho.

use crate::passes::splat::{Intersection, Splat};
use crate::scene::{Camera, Projection, Scene};
use glam::{DVec2, DVec3, Vec3};

/// Half a unit in the last place of 1 in f32.
pub const E: f64 = 1.0 / 16_777_216.0;
/// Relative error of doubled arithmetic.
const DOUBLED: f64 = 1.0 / (1u64 << 42) as f64;
/// Relative error of row a of a thin splat: 36 bits in the record, and three more roundings when it
/// is evaluated.
const THIN: f64 = 1.0 / (1u64 << 35) as f64;

/// Bounds on the difference between device and twin at one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// Absolute error of rho = |(u, v)|.
    pub rho: f64,
    /// Relative error of the depth.
    pub depth: f64,
}

/// The properties of a splat that its error bounds depend on.
pub struct Precision {
    pub(super) projection: Projection,
    /// The cosine of the module's documentation.
    pub cosine: f64,
    pub(super) s: DVec3,
    pub(super) t: DVec3,
    pub(super) distance: f64,
    center_z: f64,
    /// The splat's centre in the image, pixels, if the record is anchored there.
    pub(super) center: Option<DVec2>,
    /// The direction through the anchor, for records that are anchored elsewhere in the image.
    pub(super) anchor_ray: DVec3,
    pub(super) principal: DVec2,
    pub(super) focal: f64,
    /// Frobenius norm of the coefficients of x and y in rows a and b. The next field is their
    /// smaller singular value.
    change: f64,
    least_change: f64,
    depth_row: DVec2,
    thin: bool,
}

impl Precision {
    /// Returns the properties of `splat`, the twin of one of the scene's surfels.
    pub fn of(splat: &Splat, scene: &Scene, camera: &Camera) -> Self {
        let surfel = &scene.surfels[splat.surfel as usize];
        let turned = |v: [f32; 3]| camera.rotation * Vec3::from_array(v).as_dvec3();
        let (s, t) = match &splat.point {
            Some(point) => point.axes().into(),
            None => (turned(surfel.s), turned(surfel.t)),
        };
        let p = camera.rotation * (scene.center(splat.surfel as usize) - (camera.eye - scene.origin));
        let normal = s.cross(t);
        let principal = DVec2::new(camera.cx, camera.cy);
        let focal = DVec2::new(camera.fx, camera.fy);
        let lengths = s.length() * t.length();
        let (cosine, image) = match camera.projection {
            Projection::Pinhole => {
                (p.dot(normal).abs() / (p.length() * lengths), focal * p.truncate() / p.z + principal)
            }
            Projection::Orthographic => (normal.z.abs() / lengths, focal * p.truncate() + principal),
        };
        let anchor = DVec2::new(splat.anchor[0] as f64, splat.anchor[1] as f64);
        let own = camera.projection == Projection::Orthographic
            || (p.z - s.z.hypot(t.z) >= camera.near && image.abs().max_element() < 4_194_304.0);
        let (a, b) = (splat.a.truncate(), splat.b.truncate());
        let change = a.length_squared() + b.length_squared();
        let determinant = a.perp_dot(b).abs();
        Self {
            projection: camera.projection,
            cosine,
            s,
            t,
            distance: p.length(),
            center_z: p.z,
            center: own.then_some(image),
            anchor_ray: ((anchor + 0.5 - principal) / focal).extend(1.0),
            principal,
            focal: focal.min_element(),
            change: change.sqrt(),
            least_change: std::f64::consts::SQRT_2 * determinant / change.sqrt(),
            depth_row: splat.c.truncate(),
            // A margin above the kernel's limit of 8: where its f32 may decide either way, the
            // wider bound is used.
            thin: own && change > 8.01 * determinant,
        }
    }

    /// Relative error of the determinant.
    fn determinant(&self) -> f64 {
        let error = 6.0 * E / self.cosine;
        if error < 0.9 { error / (1.0 - error) } else { f64::INFINITY }
    }

    /// Whether the device may rightly differ about which side of the disk is seen, or whether the
    /// disk is seen.
    pub fn side_is_open(&self) -> bool {
        self.determinant().is_infinite()
    }

    /// Bounds the error of the device's record at pixel (x, y), where the twin has the intersection
    /// `at`. Leaves out the rounding of the evaluation.
    pub fn record(&self, splat: &Splat, x: u32, y: u32, at: &Intersection) -> Bound {
        self.bound(splat, x, y, at, 0.0)
    }

    /// Bounds the device's error at pixel (x, y), including the evaluation.
    pub fn fragment(&self, splat: &Splat, x: u32, y: u32, at: &Intersection) -> Bound {
        self.bound(splat, x, y, at, 4.0 * E)
    }

    fn bound(&self, splat: &Splat, x: u32, y: u32, at: &Intersection, evaluation: f64) -> Bound {
        let step = DVec2::new(f64::from(x) - splat.anchor[0] as f64, f64::from(y) - splat.anchor[1] as f64);
        let reach = step.abs().element_sum() + 1.0;
        let rho = at.rho2.sqrt();
        // Factors by which an error of a row changes (u, v).
        let z = if self.projection == Projection::Pinhole { at.depth } else { 1.0 };
        let inverse_axes = (1.0 / self.s.length() + 1.0 / self.t.length()) / self.cosine;
        let Some(center) = self.center else {
            let ray = self.anchor_ray.length() + step.length() / self.focal;
            let anchor = self.principal.abs().element_sum() + splat.anchor[0].abs().max(splat.anchor[1].abs()) as f64;
            let factor =
                (15.0 * E + evaluation) * ray + 5.0 * E * self.anchor_ray.length() + 3.0 * E * anchor / self.focal;
            let depth = z * factor / (self.distance * self.cosine) + self.determinant() + evaluation;
            return Bound {
                rho: z * inverse_axes * factor + rho * (self.determinant() + depth + 1.5 * evaluation),
                depth,
            };
        };
        let from_center = DVec2::new(f64::from(x), f64::from(y)) + 0.5 - center;
        let distance = from_center.length();
        let slope = self.depth_row.dot(from_center).abs();
        let steps = self.depth_row.length() * (distance + 1.0);
        let depth = match self.projection {
            Projection::Pinhole => {
                let rows = 15.0 * E * distance / (self.distance * self.cosine * self.focal);
                let sum = evaluation * (self.depth_row.length() * reach + 1.0 / self.center_z);
                z * (3.0 * E / self.center_z + rows + 3.0 * E * steps + slope * self.determinant() + sum) + evaluation
            }
            Projection::Orthographic => {
                let rows = 16.0 * E * distance / (self.cosine * self.focal);
                let sum = evaluation * (self.depth_row.length() * reach + self.center_z.abs());
                (2.0 * E * self.center_z.abs() + rows + 3.0 * E * steps + slope * self.determinant() + sum)
                    / at.depth.abs()
            }
        };
        let offset = DOUBLED * (center.abs() + self.principal.abs() + 1.0).element_sum();
        let uv = if self.thin {
            let beyond = if reach > 1000.0 { E * self.change * reach } else { 0.0 };
            let stored = THIN + 2.0 * evaluation / E * THIN;
            z * (DOUBLED * inverse_axes / self.focal * distance
                + stored * self.change * reach
                + beyond
                + self.change * offset
                + (4.0 * E + evaluation) * self.least_change * reach)
                + rho * (4.0 * E + 8.0 * DOUBLED / self.cosine)
        } else {
            z * (10.0 * E * inverse_axes / self.focal * distance
                + 4.0 * E * self.change * (distance + 1.0)
                + self.change * (offset + 5.0 * E)
                + evaluation * self.change * reach)
                + rho * self.determinant()
        };
        let depth_in_rho = if self.projection == Projection::Pinhole { depth } else { 0.0 };
        Bound { rho: uv + rho * (depth_in_rho + 1.5 * evaluation), depth }
    }
}
