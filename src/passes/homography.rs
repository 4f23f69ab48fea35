//! A disk's image in one camera: the homography from pixels to the disk, and the extent of its
//! outline.
//!
//! The twin of `wgsl/common/camera_pinhole.wgsl`, `wgsl/common/camera_orthographic.wgsl` and
//! `wgsl/lenses/camera_lens.wgsl`.
//!
//! **Homography.** For the ray through a pixel, d = K^-1 (x, y, 1), the disk's point satisfies `(a,
//! b, c) = [s t p]^-1 d`, and `u = a/c`, `v = b/c`, `z = 1/c` (Botsch et al. 2005, section 4). The
//! rows of that matrix are `t x p`, `p x s` and `s x t`, divided by `p . (s x t)`. It is stored
//! relative to the pixel that holds the splat's own centre: relative to the image's origin, a splat
//! of two pixels at column 1000 would lose nine bits of its shape to cancellation. The kernel finds
//! that centre in doubled f32 precision (`wgsl/common/double.wgsl`), so u and v err by a few units
//! of 2^-24, divided by the cosine of the angle between view ray and normal.
//!
//! **Lenses.** A lens that is no pinhole ([`Optics`](crate::scene::Optics)) is replaced, for each
//! splat, by a pinhole that agrees with it at the splat's centre, in place and in first
//! derivatives. Its axis is the ray through the centre, its focal length a pixel, and a vector v
//! has the axes `(z J v, g . v)`: J is the derivative of the image, z the centre's depth and g the
//! depth's gradient. The centre is exact, and at a distance of q pixels from it the image errs by
//! half the lens's curvature times q². For a distorted perspective g is the camera's axis, so
//! depths and the foreshortening of the disk are exact too, and only the distortion is linearised.
//!
//! **Extent.** The lines x = k that are tangent to the disk's outline solve a quadratic in k. A
//! disk that crosses the near depth is bounded by its part in front of it.

use glam::{DVec2, DVec3};

use crate::scene::{Camera, Projection};

/// A disk's homography and the extent of its image, pixels.
pub(super) struct Projected {
    pub(super) anchor: [i64; 2],
    pub(super) a: DVec3,
    pub(super) b: DVec3,
    pub(super) c: DVec3,
    pub(super) low: DVec2,
    pub(super) high: DVec2,
    /// Whether the normal points away from the viewer.
    pub(super) away: bool,
    /// The centre relative to the anchor's centre, and the images of the half-axes. `None` unless
    /// the anchor is the splat's own centre pixel.
    pub(super) images: Option<[DVec2; 3]>,
}

/// The largest coordinate of an anchor, pixels, which is exact in f32. A disk whose centre lies
/// farther outside is anchored at the middle of the image.
const FARTHEST_ANCHOR: f64 = 4_194_304.0;

/// Projects the disk with centre `p` and half-axes `s` and `t` (camera space). Part of it must lie
/// beyond the near depth.
pub(super) fn projected(camera: &Camera, p: DVec3, s: DVec3, t: DVec3) -> Projected {
    match camera.projection {
        Projection::Pinhole => pinhole(camera, p, s, t),
        Projection::Orthographic => orthographic(camera, p, s, t),
    }
}

/// Half the disk's extent in depth.
pub(super) fn slope(s: DVec3, t: DVec3) -> f64 {
    s.z.hypot(t.z)
}

/// A splat's centre as a lens sees it, and its half-axes in the axes of the splat's own pinhole
/// ([`lens`]).
pub(super) struct Own {
    /// The image of the centre, pixels.
    pub(super) image: DVec2,
    /// The depth of the centre.
    pub(super) depth: f64,
    pub(super) s: DVec3,
    pub(super) t: DVec3,
    /// The rows of the change to these axes.
    rows: [DVec3; 3],
}

impl Own {
    /// A vector of camera space in these axes.
    pub(super) fn axes(&self, v: DVec3) -> DVec3 {
        DVec3::from_array(self.rows.map(|row| row.dot(v)))
    }

    /// The own pinhole, with the size and the near depth of `camera`.
    pub(super) fn camera(&self, camera: &Camera) -> Camera {
        let DVec2 { x: cx, y: cy } = self.image;
        Camera { fx: 1.0, fy: 1.0, cx, cy, optics: None, ..camera.clone() }
    }
}

/// The own pinhole of a splat with centre `p` and half-axes `s` and `t` (camera space); `None` if
/// the lens does not see the centre, or the centre lies before the near depth or far outside the
/// image.
pub(super) fn own(camera: &Camera, p: DVec3, s: DVec3, t: DVec3) -> Option<Own> {
    let reach = camera.optics.as_ref()?.reach();
    let sight = camera.sight(p).filter(|sight| sight.depth >= camera.near && sight.radius <= reach)?;
    let focal = DVec2::new(camera.fx, camera.fy);
    let image = focal * sight.plane + DVec2::new(camera.cx, camera.cy);
    let [across, down] = [sight.steps[0] * focal.x, sight.steps[1] * focal.y];
    let rows = [across, down, sight.axis];
    let of = |v: DVec3| DVec3::from_array(rows.map(|row| row.dot(v)));
    (image.abs().max_element() < FARTHEST_ANCHOR).then(|| Own { image, depth: sight.depth, s: of(s), t: of(t), rows })
}

/// Projects a disk by a pinhole of its own: one with focal lengths of a pixel, whose axis is the
/// ray through the disk's centre, and whose image agrees with that of the lens at the centre, in
/// place and in first derivatives.
pub(super) fn lens(near: f64, own: &Own) -> Projected {
    let Own { image, depth, s, t, .. } = *own;
    let away = depth * (s.x * t.y - s.y * t.x);
    let edge_on = away == 0.0;
    let scale = if edge_on { 0.0 } else { 1.0 / away };
    let a = DVec2::new(t.y, -t.x) * (depth * scale);
    let b = DVec2::new(-s.y, s.x) * (depth * scale);
    let c = s.cross(t).truncate() * scale;
    let pixel = image.floor();
    let offset = image - pixel - 0.5;
    let slope = slope(s, t);
    let is_whole = depth - slope >= near;
    let (across, down, border) = match is_whole {
        true => {
            let along = |s: f64, t: f64| tangents([s, own.s.z], [t, own.t.z], [0.0, depth]);
            (along(s.x, t.x), along(s.y, t.y), 0.0)
        }
        false => {
            let ends = chord(s, t, depth, slope, near);
            let along = |s: f64, t: f64| clipped_extent([s, own.s.z], [t, own.t.z], [0.0, depth], ends, near);
            (along(s.x, t.x), along(s.y, t.y), 1.0)
        }
    };
    Projected {
        anchor: [pixel.x as i64, pixel.y as i64],
        a: a.extend(if edge_on { 2.0 / depth } else { -a.dot(offset) }),
        b: b.extend(-b.dot(offset)),
        c: c.extend(1.0 / depth - c.dot(offset)),
        low: image + DVec2::new(across.x, down.x) - border,
        high: image + DVec2::new(across.y, down.y) + border,
        away: away > 0.0,
        images: is_whole.then(|| [offset, s.truncate() / depth, t.truncate() / depth]),
    }
}

fn pinhole(camera: &Camera, p: DVec3, s: DVec3, t: DVec3) -> Projected {
    let away = p.dot(s.cross(t));
    let focal = DVec2::new(camera.fx, camera.fy);
    let principal = DVec2::new(camera.cx, camera.cy);
    // Edge-on, all rows are 0. The row `a` then gives u = 2, which is outside the disk.
    let edge_on = away == 0.0;
    let scale = if edge_on { 0.0 } else { 1.0 / away };
    let (a, b, c) = (t.cross(p) * scale, p.cross(s) * scale, s.cross(t) * scale);
    // d = ((x - cx)/fx, (y - cy)/fy, 1): the homography's columns per pixel.
    let per_pixel = |row: DVec3| row.truncate() / focal;
    let (a_xy, b_xy, c_xy) = (per_pixel(a), per_pixel(b), per_pixel(c));
    let slope = slope(s, t);
    let image = focal * p.truncate() / p.z + principal;
    if p.z - slope >= camera.near && image.abs().max_element() < FARTHEST_ANCHOR {
        let pixel = image.floor();
        let offset = image - pixel - 0.5;
        let image_of = |v: DVec3| focal * (v.truncate() - p.truncate() / p.z * v.z) / p.z;
        let across = tangents([s.x, s.z], [t.x, t.z], [p.x, p.z]) * camera.fx;
        let down = tangents([s.y, s.z], [t.y, t.z], [p.y, p.z]) * camera.fy;
        return Projected {
            anchor: [pixel.x as i64, pixel.y as i64],
            a: a_xy.extend(if edge_on { 2.0 / p.z } else { -a_xy.dot(offset) }),
            b: b_xy.extend(-b_xy.dot(offset)),
            c: c_xy.extend(1.0 / p.z - c_xy.dot(offset)),
            low: image + DVec2::new(across.x, down.x),
            high: image + DVec2::new(across.y, down.y),
            away: away > 0.0,
            images: Some([offset, image_of(s), image_of(t)]),
        };
    }
    let anchor = [i64::from(camera.width / 2), i64::from(camera.height / 2)];
    let center = DVec2::new(anchor[0] as f64, anchor[1] as f64) + 0.5;
    let d = ((center - principal) / focal).extend(1.0);
    let ends = chord(s, t, p.z, slope, camera.near);
    let across = clipped_extent([s.x, s.z], [t.x, t.z], [p.x, p.z], ends, camera.near) * camera.fx + camera.cx;
    let down = clipped_extent([s.y, s.z], [t.y, t.z], [p.y, p.z], ends, camera.near) * camera.fy + camera.cy;
    Projected {
        anchor,
        a: a_xy.extend(a.dot(d)),
        b: b_xy.extend(b.dot(d)),
        c: c_xy.extend(c.dot(d)),
        low: DVec2::new(across.x, down.x) - 1.0,
        high: DVec2::new(across.y, down.y) + 1.0,
        away: away > 0.0,
        images: None,
    }
}

/// X/Z of the two tangents to a disk in front of the camera, relative to X/Z of its centre. Vectors
/// are (x, z); with y in place of x, the result is Y/Z.
fn tangents(s: [f64; 2], t: [f64; 2], p: [f64; 2]) -> DVec2 {
    let ratio = p[0] / p[1];
    let (s_x, t_x) = (s[0] - ratio * s[1], t[0] - ratio * t[1]);
    let e = s_x * s_x + t_x * t_x;
    let b = s_x * s[1] + t_x * t[1];
    let slope = s[1].hypot(t[1]);
    let d = (p[1] - slope) * (p[1] + slope);
    let far = b.abs() + (b * b + d * e).sqrt();
    let near = if far > 0.0 { e / far } else { 0.0 };
    if b >= 0.0 { DVec2::new(-far / d, near) } else { DVec2::new(-near, far / d) }
}

/// The disk coordinates (u, v) of both ends of the chord at depth `near`.
fn chord(s: DVec3, t: DVec3, p_z: f64, slope: f64, near: f64) -> [DVec2; 2] {
    if slope == 0.0 {
        return [DVec2::ZERO; 2];
    }
    let steepest = DVec2::new(s.z, t.z) / slope;
    let along = ((near - p_z) / slope).clamp(-1.0, 1.0);
    let half = (1.0 - along * along).max(0.0).sqrt();
    [along * steepest + half * steepest.perp(), along * steepest - half * steepest.perp()]
}

/// The X/Z extent of the part of a disk at depths of at least `near`.
fn clipped_extent(s: [f64; 2], t: [f64; 2], p: [f64; 2], ends: [DVec2; 2], near: f64) -> DVec2 {
    let ends = ends.map(|uv| (p[0] + uv.x * s[0] + uv.y * t[0]) / near);
    let (mut low, mut high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let a = s[1] * s[1] + t[1] * t[1] - p[1] * p[1];
    let b = s[0] * s[1] + t[0] * t[1] - p[0] * p[1];
    let c = s[0] * s[0] + t[0] * t[0] - p[0] * p[0];
    let discriminant = b * b - a * c;
    if discriminant >= 0.0 {
        let q = b + if b >= 0.0 { discriminant.sqrt() } else { -discriminant.sqrt() };
        for k in [q / a, c / q] {
            let line = [s[0] - k * s[1], t[0] - k * t[1], p[0] - k * p[1]];
            let depth = p[1] - (line[0] * s[1] + line[1] * t[1]) / line[2];
            if depth >= 0.5 * near {
                (low, high) = (low.min(k), high.max(k));
            }
        }
    }
    DVec2::new(low, high)
}

fn orthographic(camera: &Camera, p: DVec3, s: DVec3, t: DVec3) -> Projected {
    let away = s.x * t.y - s.y * t.x;
    let focal = DVec2::new(camera.fx, camera.fy);
    let image = focal * p.truncate() + DVec2::new(camera.cx, camera.cy);
    let pixel = image.floor();
    let offset = image - pixel - 0.5;
    let edge_on = away == 0.0;
    let scale = if edge_on { DVec2::ZERO } else { 1.0 / (away * focal) };
    let a = DVec2::new(t.y, -t.x) * scale;
    let b = DVec2::new(-s.y, s.x) * scale;
    let c = s.z * a + t.z * b;
    let extent = focal * DVec2::new(s.x.hypot(t.x), s.y.hypot(t.y));
    Projected {
        anchor: [pixel.x as i64, pixel.y as i64],
        a: a.extend(if edge_on { 2.0 } else { -a.dot(offset) }),
        b: b.extend(-b.dot(offset)),
        c: c.extend(p.z - c.dot(offset)),
        low: image - extent,
        high: image + extent,
        away: away > 0.0,
        images: Some([offset, focal * s.truncate(), focal * t.truncate()]),
    }
}
