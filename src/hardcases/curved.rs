//! Error bounds of caps, and scenes of caps that are hard to intersect.
//!
//! The bounds limit how far a fragment of the device may lie from its f64 twin. They follow, to
//! first order, from the operations of `wgsl/project/curved.wgsl`. With the names of
//! [`passes::curved`](crate::passes::curved), e = 2^-24, k = |s||t| / |s x t|, and all lengths in
//! units of r:
//!
//! - The rows of N have lengths of at most r k/|s|, r k/|t| and 1, and relative errors of 24 e k.
//! - (U, V, W) is N times a point of the ray, at a distance d from the centre. The error of that
//!   point is 24 e k d (the rows), 5 e of a pixel (the stored centre), 3 e of the coefficients, and
//!   4 e of the terms that the evaluation sums. If the record is not anchored at the centre, the
//!   point is the difference of two points, each with an error of 7 e.
//! - The step (U, V, W) r/z + D errs by r/z times the error of (U, V, W), by 24 e k of a row, and
//!   by 4 e of itself.
//! - The errors of the quadratic's coefficients follow from its derivatives, plus 12 e of the terms
//!   that each coefficient sums.
//! - The discriminant Q then errs by some dQ. If |Q| > dQ, the number of roots is certain. A root
//!   then errs by at most 2 dF / sqrt(Q - dQ), if that is less than half the distance to the other
//!   root. Here dF is the error of the polynomial at the twin's root; the stable formula adds 12 e
//!   of the polynomial's terms to it.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::HardCase;
use super::precision::{Bound, E, Precision};
use super::staging::{BOTH, Entry, Filling, Stage, build, fraction};
use crate::error::Result;
use crate::passes::curved::Curve;
use crate::passes::splat::{Intersection, Splat};
use crate::scene::{Cap, Clip, Projection};

/// Greatest distance of a hit along the ray, in units of r (`FARTHEST_HIT` in the kernel).
const FARTHEST_HIT: f64 = 8.0;

/// The errors of U and V together, and of W.
#[derive(Clone, Copy)]
struct Errors {
    uv: f64,
    w: f64,
}

impl Precision {
    /// Bounds the device's error at pixel (x, y) of a splat that curves, including the evaluation.
    pub fn cap(&self, curve: &Curve, splat: &Splat, (x, y): (u32, u32), at: &Intersection) -> Bound {
        const NOTHING: Bound = Bound { rho: f64::INFINITY, depth: f64::INFINITY };
        let d = DVec2::new(f64::from(x) - splat.anchor[0] as f64, f64::from(y) - splat.anchor[1] as f64);
        let row = |row: DVec3| row.dot(d.extend(1.0));
        let start = DVec3::new(row(curve.u), row(curve.v), row(curve.w));
        let step = start * curve.spread + curve.along;
        let [of_start, of_step] = self.errors(curve, (d, splat.anchor), (start, step));
        let bent = |a: DVec3, b: DVec3| {
            let [uu, uv, vv] = curve.heights;
            uu * a.x * b.x + uv * (a.x * b.y + a.y * b.x) + vv * a.y * b.y
        };
        let [a, b, c] = [0.5 * bent(step, step), bent(start, step) - step.z, 0.5 * bent(start, start) - start.z];
        let h = curve.heights[0].abs() + 2.0 * curve.heights[1].abs() + curve.heights[2].abs();
        let (s, t) = (start.truncate().length(), step.truncate().length());
        let da = h * of_step.uv * (t + of_step.uv) + 12.0 * E * 0.5 * h * t * t;
        let db =
            h * (s * of_step.uv + (t + of_step.uv) * of_start.uv) + of_step.w + 12.0 * E * (h * s * t + step.z.abs());
        let dc = h * of_start.uv * (s + of_start.uv) + of_start.w + 12.0 * E * (0.5 * h * s * s + start.z.abs());
        let discriminant = b * b - 4.0 * a * c;
        let unknown = 2.0 * b.abs() * db
            + db * db
            + 4.0 * ((a.abs() + da) * dc + c.abs() * da)
            + 12.0 * E * (b * b + (4.0 * a * c).abs());
        if discriminant < -unknown {
            return Bound { rho: 0.0, depth: 0.0 };
        }
        let slope = (discriminant - unknown).sqrt();
        // Uses the larger root, as it must be certain for both roots whether they are hits.
        let far = -0.5 * (b + discriminant.max(0.0).sqrt().copysign(b));
        let sigma = [far / a, c / far].map(f64::abs).into_iter().fold(0.0, f64::max).min(FARTHEST_HIT);
        let terms = a.abs() * sigma * sigma + b.abs() * sigma + c.abs();
        let value = da * sigma * sigma + db * sigma + dc + 12.0 * E * terms;
        let apart = slope * slope / (4.0 * (a.abs() + da));
        // With NaN, nothing is certain.
        if value.is_nan() || apart.is_nan() || value >= apart {
            return NOTHING;
        }
        let moved = 2.0 * value / slope;
        let rounding = 3.0 * E * (curve.depth.abs() + curve.radius * sigma);
        Bound {
            rho: of_start.uv + sigma * of_step.uv + t * moved + 3.0 * E * (s + sigma * t),
            depth: (curve.radius * moved + rounding) / at.depth.abs(),
        }
    }

    /// The errors of (U, V, W) and of its step.
    fn errors(&self, curve: &Curve, (d, anchor): (DVec2, [i64; 2]), (start, step): (DVec3, DVec3)) -> [Errors; 2] {
        let (s, t) = (self.s.length(), self.t.length());
        let skew = s * t / self.s.cross(self.t).length();
        let known = 24.0 * E * skew;
        // Length of the rows of U and V together.
        let rows = (curve.radius * skew / s).hypot(curve.radius * skew / t);
        // Size of a pixel, in units of r.
        let widening = if self.projection == Projection::Pinhole { curve.depth } else { 1.0 };
        let pixel = widening / (self.focal * curve.radius);
        let reach = d.abs().element_sum() + 1.0;
        let point = match self.center {
            Some(center) => {
                let anchor = DVec2::new(anchor[0] as f64, anchor[1] as f64) + 0.5;
                let distance = (d + anchor - center).length();
                pixel * (known * distance + 5.0 * E + 3.0 * E * (distance + 1.0) + 4.0 * E * reach)
            }
            None => {
                let far = anchor[0].abs().max(anchor[1].abs()) as f64 + self.principal.abs().element_sum();
                let of_anchor = 7.0 * E * (self.anchor_ray.length() * curve.depth + self.distance) / curve.radius;
                let distance = (self.anchor_ray.length() * curve.depth + self.distance) / curve.radius;
                of_anchor + known * distance + pixel * (3.0 * E * far + (known + 7.0 * E) * reach)
            }
        };
        let of_start = Errors { uv: rows * point, w: point };
        let along = if self.projection == Projection::Pinhole { self.distance / curve.depth } else { 1.0 };
        let of_step = |error: f64, row: f64, start: f64, step: f64| {
            (error + 4.0 * E * start) * curve.spread + (known + 3.0 * E) * row * along + 4.0 * E * step
        };
        let [s, t] = [start, step].map(|v| v.truncate().length());
        let of_step =
            Errors { uv: of_step(of_start.uv, rows, s, t), w: of_step(of_start.w, 1.0, start.z.abs(), step.z.abs()) };
        [of_start, of_step]
    }
}

/// The parts of the cases' bounds.
const ROOTS: &str = "the roots of a quadratic with uncertain coefficients: 2 dF / sqrt(Q - dQ)";

/// Builds the cases.
pub fn cases() -> Result<Vec<HardCase>> {
    build(LIST)
}

const LIST: &[Entry] = &[
    Entry {
        name: "caps of all shapes",
        about: "Bowls, domes, saddles, channels and flat disks, round or eight times as long as wide, some cut by lines.",
        bound: ROOTS,
        size: (64, 48),
        stage: Stage::askew,
        fill: shapes,
        projections: BOTH,
    },
    Entry {
        name: "caps of sixteen sides",
        about: "The same caps as polygons with 16 sides, the most there can be: the last side is rotated most often.",
        bound: "the roots' bound, and for a side the error of (u, v) and 50 u of the distance",
        size: (64, 48),
        stage: Stage::askew,
        fill: |stage| shapes(stage).outline(16),
        projections: BOTH,
    },
    Entry {
        name: "caps that fold",
        about: "Caps as high as they are wide, seen from the side: a ray meets them twice, once, or just misses.",
        bound: ROOTS,
        size: (64, 48),
        stage: Stage::askew,
        fill: folded,
        projections: BOTH,
    },
    Entry {
        name: "caps, edge-on",
        about: "Caps of heights from 1e-6 to 1e-1 of their size, tilted by 1e-5 to 1e-2 from edge-on, in front of a sheet.",
        bound: ROOTS,
        size: (64, 48),
        stage: Stage::askew,
        fill: edge_on,
        projections: BOTH,
    },
    Entry {
        name: "caps at the camera plane",
        about: "Caps from behind the camera to in front of it, from a fraction of a pixel to the whole image.",
        bound: ROOTS,
        size: (48, 40),
        stage: Stage::plain,
        fill: near,
        projections: BOTH,
    },
];

/// Returns cap number `k` of a series at depths around 3: round, or long if `thin` is less than 1.
/// `height` is in units of the longer half-axis.
fn scattered(stage: &Stage, k: usize, pixels: f64, thin: f64, height: f64) -> (crate::scene::Surfel, Cap) {
    let (width, rows) = stage.size();
    let z = 3.0 + 0.2 * fraction(k, 0);
    let center = stage.at(width as f64 * fraction(k, 1), rows as f64 * fraction(k, 2), z);
    let normal = DVec3::new(fraction(k, 3) - 0.5, fraction(k, 4) - 0.5, -1.0).normalize();
    let (a, b) = normal.any_orthonormal_pair();
    let radius = pixels * stage.pixel(z);
    let angle = TAU * fraction(k, 5);
    let heights = [angle.cos(), 0.5 * (3.0 * angle).sin(), angle.sin()];
    let cap = Cap(heights.map(|h| (h * height * radius * stage.unit) as f32));
    (stage.surfel(center, a * radius, b * (radius * thin)), cap)
}

fn shapes(stage: &Stage) -> Filling {
    let of = |k: usize| {
        let thin = if k.is_multiple_of(3) { 0.125 } else { 1.0 };
        let (surfel, cap) = scattered(stage, k, 3.0 + 6.0 * fraction(k, 4), thin, 0.5);
        (surfel, if k.is_multiple_of(5) { Cap::FLAT } else { cap })
    };
    let (surfels, caps): (Vec<_>, Vec<_>) = (0..160).map(of).unzip();
    let line = |k: usize| [(TAU * fraction(k, 3)).cos() as f32, (TAU * fraction(k, 3)).sin() as f32, 0.2];
    let clips = (0..160).map(|k| if k % 4 == 1 { Clip([line(k), Clip::NONE.0[0]]) } else { Clip::NONE });
    let clips = clips.collect();
    Filling { clips, caps, excused: 0.05, ..Filling::of(surfels, (0.7, 1.0)).with_lone_rims() }
}

fn folded(stage: &Stage) -> Filling {
    let of = |k: usize| {
        let center = stage.at(64.0 * fraction(k, 0), 48.0 * fraction(k, 1), 2.5 + fraction(k, 2));
        let ray = stage.ray(center);
        let side = DVec3::new(fraction(k, 3) - 0.5, fraction(k, 4) - 0.5, 0.1).cross(ray).normalize();
        let away = (ray + ray.cross(side) * (0.6 * (fraction(k, 5) - 0.5))).normalize();
        let radius = 0.1 + 0.3 * fraction(k, 3);
        let heights = [[1.0, 0.0, 1.0], [-1.0, 0.0, -1.0], [1.5, 0.3, -1.5], [0.0, 0.0, 2.0]][k % 4];
        (stage.surfel(center, side * radius, away * radius), Cap(heights.map(|h| (h * radius * stage.unit) as f32)))
    };
    let (surfels, caps): (Vec<_>, Vec<_>) = (0..60).map(of).unzip();
    Filling { caps, excused: 0.08, ..Filling::of(surfels, (0.2, 1.0)).with_lone_rims() }
}

fn edge_on(stage: &Stage) -> Filling {
    let mut surfels = stage.sheet(5.0, 0.3, |_, _| 4.0);
    let mut caps = vec![Cap::FLAT; surfels.len()];
    for k in 0..40 {
        let center = stage.at(64.0 * fraction(k, 0), 48.0 * fraction(k, 1), 2.0 + fraction(k, 2));
        let ray = stage.ray(center);
        let side = DVec3::new(fraction(k, 3) - 0.5, fraction(k, 4) - 0.5, 0.1).cross(ray).normalize();
        let away = (ray + ray.cross(side) * 10f64.powf(-5.0 + 3.0 * fraction(k, 5))).normalize();
        surfels.push(stage.surfel(center, side * 0.5, away * 0.5));
        let height = 0.5 * stage.unit * 10f64.powf(-6.0 + 5.0 * fraction(k, 1));
        caps.push(Cap([height, 0.2 * height, if k % 2 == 0 { height } else { -height }].map(|h| h as f32)));
    }
    Filling { caps, excused: 0.15, ..Filling::of(surfels, (1.0, 1.0)).with_lone_rims() }
}

fn near(stage: &Stage) -> Filling {
    let of = |k: usize| {
        let center = DVec3::new(3.0 * (fraction(k, 0) - 0.5), 3.0 * (fraction(k, 1) - 0.5), fraction(k, 2) - 0.3);
        let normal = DVec3::new(fraction(k, 3) - 0.5, fraction(k, 4) - 0.5, fraction(k, 5) - 0.5);
        let radius = 0.02 * 2f64.powf(6.0 * fraction(k, 1));
        let height = (fraction(k, 2) - 0.5) * radius * stage.unit;
        (stage.disk(center, normal, radius), Cap([height, 0.3 * height, -0.5 * height].map(|h| h as f32)))
    };
    let (surfels, caps): (Vec<_>, Vec<_>) = (0..80).map(of).unzip();
    Filling { caps, excused: 0.1, ..Filling::of(surfels, (0.2, 1.0)).with_lone_rims() }
}
