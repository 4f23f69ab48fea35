//! A cap at a pixel: a surfel that curves out of its plane ([`Cap`]). The twin of
//! `wgsl/project/curved.wgsl`.
//!
//! **Rows.** With N the inverse of [s t n], n the unit normal, a point q relative to the surfel's
//! centre has the coordinates `(u, v, w) = N q`, and the cap is
//! `w = (uu u² + 2 uv u v + vv v²) / 2`. On the ray through a pixel, take the point at the depth of
//! the centre. Its coordinates (U, V, W) are affine in the pixel, and 0 at the image of the centre.
//! The rows of U, V and W are stored relative to the pixel that holds the centre, like the rows of
//! a [homography](super::homography). While the depth grows by r, the longer half-axis, the point
//! on the ray advances by `(U, V, W) r/z + D`, where D = N p r/z (pinhole) or D = N e r
//! (orthographic, e the ray's direction). All these numbers are near 1 at any scale of the scene,
//! if the surfel is not much larger than its depth.
//!
//! **Intersection.** `a σ² + b σ + c = 0`, where σ is the distance along the ray, in steps by which
//! the depth grows by r. The hit is the nearest root that lies on the cap, inside its clip lines
//! and past the near depth. The sign of the slope at the hit tells which side is seen. For a flat
//! disk the equation is that of its plane. (Specified after paper 001, which gives no formula.)

use glam::{DVec2, DVec3};

use super::homography::Projected;
use super::splat::{Intersection, Splat};
use crate::scene::{Camera, Cap, Projection};

/// The curvature of a splat, prepared for the pixels of one camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// The row of U: `u . (dx, dy, 1)` is U at a pixel (dx, dy) from the anchor.
    pub u: DVec3,
    /// The row of V.
    pub v: DVec3,
    /// The row of W, in units of [`Self::radius`].
    pub w: DVec3,
    /// D, the constant part of the ray's advance.
    pub along: DVec3,
    /// r/z; 0 for an orthographic camera.
    pub spread: f64,
    /// r, the longer half-axis, world units.
    pub radius: f64,
    /// The depth at which U, V and W are taken, world units.
    pub depth: f64,
    /// The cap's coefficients (uu, uv, vv) in units of r.
    pub heights: [f64; 3],
    /// The change of the normal per unit of u and of v, world space, where the centre's normal has
    /// length 1.
    pub slopes: [DVec3; 2],
    /// Whether back faces are left out.
    pub culls: bool,
}

impl Curve {
    /// Whether every point of the cap shows its back.
    ///
    /// With P = N p, the product of the normal and the view ray is `P_w - h - slope . (P_u, P_v)`
    /// at height h; here divided by z (pinhole).
    pub fn faces_away(&self) -> bool {
        let cap = Cap(self.heights.map(|height| height as f32));
        self.along.z - cap.extremes()[1] * self.spread - cap.slope(self.along.x, self.along.y).length() > 0.0
    }
}

/// A surfel in camera space, or in the axes of its own pinhole for a lens that is none: centre p,
/// half-axes s and t, and cap.
pub(super) struct Seen {
    pub p: DVec3,
    pub s: DVec3,
    pub t: DVec3,
    /// The image of the unit normal in these axes, which need not be perpendicular.
    pub normal: DVec3,
    /// The longer half-axis, world units.
    pub radius: f64,
    pub cap: Cap,
}

impl Seen {
    /// The smallest and the largest depth of the cap's bounding box.
    pub fn depths(&self) -> [f64; 2] {
        let slope = self.s.z.hypot(self.t.z);
        let [low, high] = self.shifts().map(|shift| shift.z);
        [self.p.z - slope + low.min(high), self.p.z + slope + low.max(high)]
    }

    /// The displacements of the disk's centre at the cap's lowest and highest point.
    fn shifts(&self) -> [DVec3; 2] {
        self.cap.extremes().map(|height| self.normal * height)
    }

    /// The first and last corner of the rectangle, in pixels, that holds the cap's image past the
    /// near depth.
    ///
    /// They bound the intersection of two boxes around the cap, each sheared along a ray. The box
    /// along the ray through the centre is tight, except beside the eye, where that ray is nearly
    /// perpendicular to the optical axis and the box fills the image. The box along the optical
    /// axis is small there.
    pub fn extent(&self, camera: &Camera) -> [DVec2; 2] {
        let focal = DVec2::new(camera.fx, camera.fy);
        let image = |point: DVec2| point * focal + DVec2::new(camera.cx, camera.cy);
        let [low, high] = match camera.projection {
            Projection::Orthographic => {
                let ([x0, x1], [y0, y1]) = (self.around(|v| v.x, 0.0), self.around(|v| v.y, 0.0));
                [DVec2::new(x0, y0), DVec2::new(x1, y1)]
            }
            Projection::Pinhole => {
                let depths = self.depths().map(|depth| depth.max(camera.near));
                let straight = self.seen_around(DVec2::ZERO, depths);
                if self.p.z > camera.near {
                    let sheared = self.seen_around(self.p.truncate() / self.p.z, depths);
                    [straight[0].max(sheared[0]), straight[1].min(sheared[1])]
                } else {
                    straight
                }
            }
        };
        [image(low), image(high)]
    }

    /// The smallest and the largest `x - ratio z` of the cap's box.
    fn around(&self, x: fn(DVec3) -> f64, ratio: f64) -> [f64; 2] {
        let of = |v: DVec3| x(v) - ratio * v.z;
        let half = of(self.s).hypot(of(self.t));
        let [a, b] = self.shifts().map(of);
        [of(self.p) - half + a.min(b), of(self.p) + half + a.max(b)]
    }

    /// The smallest and the largest (X/Z, Y/Z), between two depths, of the cap's box sheared along
    /// the ray (`ratio`, 1).
    fn seen_around(&self, ratio: DVec2, [near, far]: [f64; 2]) -> [DVec2; 2] {
        let seen = |[low, high]: [f64; 2], ratio: f64| {
            [low / if low < 0.0 { near } else { far } + ratio, high / if high > 0.0 { near } else { far } + ratio]
        };
        let [x0, x1] = seen(self.around(|v| v.x, ratio.x), ratio.x);
        let [y0, y1] = seen(self.around(|v| v.y, ratio.y), ratio.y);
        [DVec2::new(x0, y0), DVec2::new(x1, y1)]
    }
}

/// The rows of the inverse of [s t n]. No two of the vectors need be perpendicular.
fn inverse(s: DVec3, t: DVec3, n: DVec3) -> [DVec3; 3] {
    let size = s.dot(t.cross(n));
    [t.cross(n) / size, n.cross(s) / size, s.cross(t) / size]
}

/// The unit normal of s and t.
pub(super) fn normal_of(s: DVec3, t: DVec3) -> DVec3 {
    s.cross(t).normalize_or_zero()
}

/// The curve of a surfel whose disk is `projected`.
pub(super) fn curve(camera: &Camera, seen: &Seen, projected: &Projected) -> Curve {
    let [m_s, m_t, n] = inverse(seen.s, seen.t, seen.normal);
    let radius = seen.radius;
    let rows = [m_s, m_t, n / radius];
    // Without an anchor at its centre, U, V and W are taken past the near depth: r / z may be large
    // where a cap lies mostly behind the camera.
    let depth = if projected.images.is_some() { seen.p.z } else { camera.near.max(seen.depths()[1]) };
    let focal = DVec2::new(camera.fx, camera.fy);
    let principal = DVec2::new(camera.cx, camera.cy);
    let pixel = DVec2::new(projected.anchor[0] as f64, projected.anchor[1] as f64) + 0.5;
    let d = ((pixel - principal) / focal).extend(1.0);
    // The point of the anchor's ray at that depth, relative to the centre.
    let (start, scale, spread) = match camera.projection {
        Projection::Pinhole => (d * depth - seen.p, depth, radius / depth),
        Projection::Orthographic => (d.truncate().extend(depth) - seen.p, 1.0, 0.0),
    };
    let row = |m: DVec3| (m.truncate() / focal * scale).extend(m.dot(start));
    let along = |m: DVec3| match camera.projection {
        Projection::Pinhole => m.dot(seen.p) * spread,
        Projection::Orthographic => m.z * radius,
    };
    Curve {
        u: row(rows[0]),
        v: row(rows[1]),
        w: row(rows[2]),
        along: DVec3::new(along(rows[0]), along(rows[1]), along(rows[2])),
        spread,
        radius,
        depth,
        heights: seen.cap.0.map(|height| f64::from(height) / radius),
        slopes: [DVec3::ZERO; 2],
        culls: false,
    }
}

/// The change of a unit normal per unit of u and of v, world space: minus the gradient of the
/// height.
pub(super) fn normal_slopes(s: DVec3, t: DVec3, cap: Cap) -> [DVec3; 2] {
    let [m_s, m_t, _] = inverse(s, t, normal_of(s, t));
    let [uu, uv, vv] = cap.0.map(f64::from);
    [-(m_s * uu + m_t * uv), -(m_s * uv + m_t * vv)]
}

/// Intersects the ray through the pixel at `d` from the anchor with the cap, and with the plane
/// that touches the cap at its centre.
///
/// For that plane, which the low-pass needs, it returns 1/z (pinhole) or z, and how far inside the
/// clip lines the point is.
pub(super) fn meet(curve: &Curve, splat: &Splat, camera: &Camera, d: DVec2) -> (Intersection, (f64, f64)) {
    let at = |row: DVec3| row.x * d.x + (row.y * d.y + row.z);
    let start = DVec3::new(at(curve.u), at(curve.v), at(curve.w));
    let step = start * curve.spread + curve.along;
    // Seen edge-on, the plane counts as met at the centre's depth.
    let to_plane = if step.z == 0.0 { 0.0 } else { -start.z / step.z };
    let depth = curve.depth + curve.radius * to_plane;
    let inside = splat.inside(start.x + to_plane * step.x, start.y + to_plane * step.y);
    let plane = match camera.projection {
        Projection::Pinhole => (1.0 / depth, inside),
        Projection::Orthographic => (depth, inside),
    };
    let way = Way::of(curve, splat, (start, step));
    let [(first, steepness), (second, steepness_of_second)] = way.hits;
    let [out, out_of_second] = [&first, &second].map(|at| outside(curve, camera, at));
    let met = if out <= 0.0 {
        first
    } else if out_of_second <= 0.0 {
        // The hit is no more certain than the miss of the first root.
        Intersection { inside: second.inside.min(out), ..second }
    } else {
        // Both roots miss. The root that misses by less says by how much the ray misses.
        let (nearer, missed) = if out_of_second < out {
            (second, way.margin(out_of_second, steepness_of_second))
        } else {
            (first, way.margin(out, steepness))
        };
        Intersection { rho2: (1.0 + missed).powi(2), inside: f64::INFINITY, ..nearer }
    };
    (met, plane)
}

/// The two intersections of a ray with the paraboloid of a cap.
struct Way {
    /// The nearer one first. The number beside each says how far it moves on the unit disk per unit
    /// of [`Self::root`].
    hits: [(Intersection, f64); 2],
    discriminant: f64,
    /// The square root of the discriminant; 0 if that is negative.
    root: f64,
    /// The sum of the discriminant's terms, each taken as positive.
    terms: f64,
}

impl Way {
    fn of(curve: &Curve, splat: &Splat, (start, step): (DVec3, DVec3)) -> Self {
        let [uu, uv, vv] = curve.heights;
        let bent = |a: DVec3, b: DVec3| uu * a.x * b.x + uv * (a.x * b.y + a.y * b.x) + vv * a.y * b.y;
        let [a, b, c] = [0.5 * bent(step, step), bent(start, step) - step.z, 0.5 * bent(start, start) - start.z];
        let discriminant = b * b - 4.0 * a * c;
        // The distance of the discriminant from 0, relative to its terms: near an outline, rounding
        // decides.
        let terms = b * b + (4.0 * a * c).abs();
        let margin = discriminant / terms;
        let root = discriminant.max(0.0).sqrt();
        let far = -0.5 * (b + if b >= 0.0 { root } else { -root });
        // The root at which the slope has the sign of b, and the one at which it has the opposite
        // sign.
        let roots = [(c / far, b < 0.0), (far / a, b >= 0.0)];
        let [one, other] = roots.map(|(sigma, away)| {
            let (u, v) = (start.x + sigma * step.x, start.y + sigma * step.y);
            let depth = curve.depth + curve.radius * sigma;
            let inside = splat.inside(u, v).min(margin);
            let steepness = (0.5 * sigma / far).abs() * step.truncate().length();
            (Intersection { depth, rho2: u * u + v * v, inside, uv: DVec2::new(u, v), away }, steepness)
        });
        let hits = if other.0.depth < one.0.depth { [other, one] } else { [one, other] };
        Self { hits, discriminant, root, terms }
    }

    /// The relative distance to a decision of a root that misses by `missed`.
    ///
    /// Near an outline a small change of the discriminant moves a root far, so that rounding
    /// decides about roots that seem to miss by more.
    fn margin(&self, missed: f64, steepness: f64) -> f64 {
        let grown = self.root + missed / steepness;
        missed.min((grown * grown - self.discriminant) / self.terms)
    }
}

/// How far an intersection is from being a hit; 0 or negative for a hit.
///
/// This is the largest of three distances: outside the unit disk, outside the clip lines, and
/// before the near depth (relative).
fn outside(curve: &Curve, camera: &Camera, at: &Intersection) -> f64 {
    let never = curve.culls && at.away || at.rho2.is_nan();
    let margins = [at.rho2.sqrt() - 1.0, -at.inside, 1.0 - at.depth / camera.near];
    if never { f64::INFINITY } else { margins.into_iter().fold(f64::NEG_INFINITY, f64::max) }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::passes::{footprint::footprint, lowpass::Design, project};
    use crate::plan::Settings;
    use crate::random::Random;
    use crate::scene::{Lens, LowPass, Surfel};
    use glam::{DMat3, Vec3};

    /// Counts the pixels in the bounds of caps of at most this height (0: flat) all around an eye.
    ///
    /// Asserts that every pixel that shows a cap lies within its bounds.
    fn pixels_in_bounds(height: f64) -> u64 {
        let size = 48;
        let camera = Camera::posed((size, size), Lens::Fov(75.0), DVec3::ZERO, DMat3::IDENTITY, 1e-3).unwrap();
        let design = Design::of(&Settings { low_pass: LowPass::None, ..Settings::default() });
        let mut random = Random::stream(5, 0);
        let mut within = 0;
        for _ in 0..2000 {
            let mut around = |least: f64| {
                let v = DVec3::from_array(std::array::from_fn(|_| 2.0 * random.number() - 1.0)).normalize_or(DVec3::X);
                v * (least + random.number())
            };
            let (center, normal) = (around(0.3) * 3.0, around(1.0).normalize());
            let disk = Surfel::disk(Vec3::ZERO, normal.as_vec3(), 0.3);
            let cap = Cap(std::array::from_fn(|_| (0.3 * height * (2.0 * random.number() - 1.0)) as f32));
            let Some(splat) = project::reference((0, &disk, Some(project::Body::Cap(cap))), center, &camera, &design)
            else {
                continue;
            };
            let ([left, top], [right, bottom]) = (splat.first, splat.last);
            within += u64::from(right - left + 1) * u64::from(bottom - top + 1);
            for (x, y) in (0..size).flat_map(|y| (0..size).map(move |x| (x, y))) {
                let hit = footprint(&splat, &camera, LowPass::None, x, y).is_some_and(|(at, _)| at.hit(&camera));
                let inside = (left..=right).contains(&x) && (top..=bottom).contains(&y);
                assert!(inside || !hit, "{center} {normal} {cap:?} shows at {x}, {y}");
            }
        }
        within
    }

    #[test]
    fn bounds_of_caps_around_the_eye_hold_little_more_than_those_of_disks() {
        let flat = pixels_in_bounds(0.0);
        let slight = pixels_in_bounds(0.1);
        assert!(flat > 0 && slight < flat * 5 / 4, "{slight} of {flat}");
        let high = pixels_in_bounds(0.6);
        assert!(high < flat * 3, "{high} of {flat}");
    }
}
