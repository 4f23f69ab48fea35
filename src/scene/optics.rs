//! Lenses that are no pinholes: distorted ones, fisheyes and whole spheres.
//!
//! A lens maps a direction to a point of the plane of the image, in units of the focal length, and
//! [`Camera`](super::Camera)'s `fx fy cx cy` map that to pixels. The map has two steps. The first
//! one depends on the [`Form`]: (X/Z, Y/Z) for a perspective, the angle from the axis in the
//! direction of (X, Y) for a fisheye, longitude and latitude for a whole sphere. The second step
//! distorts the result e, with `r² = e . e`:
//!
//! `e' = e (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) / (1 + k5 r² + k6 r⁴ + k7 r⁶)
//!       + (2 p1 ex ey + p2 (r² + 2 ex²) + s1 r², 2 p2 ex ey + p1 (r² + 2 ey²) + s2 r²)`
//!
//! (Brown 1966 with the rational radial term and the thin prism of OpenCV and COLMAP.) Beyond the
//! radius at which the radial part stops growing, such a polynomial would fold the scene back into
//! the image; there the lens shows nothing ([`Optics::limit`]).
//!
//! **Depth** is camera-space z for a perspective and the FOV model, and the distance from the eye
//! for the other forms, which also see what lies behind the plane of the eye.

mod inverse;

use std::f64::consts::{PI, TAU};
use std::str::FromStr;

use glam::{DMat2, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// The first step of a lens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Form {
    /// `(X/Z, Y/Z)`, in front of the eye alone.
    Perspective,
    /// The angle from the axis, radians, in the direction of (X, Y): an equidistant fisheye.
    Fisheye,
    /// Longitude and latitude, radians, to the right and down.
    Equirectangular,
}

/// All forms with their names.
const FORMS: [(&str, Form); 3] =
    [("perspective", Form::Perspective), ("fisheye", Form::Fisheye), ("equirectangular", Form::Equirectangular)];

impl FromStr for Form {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let named = FORMS.iter().find(|(name, _)| *name == text).map(|(_, form)| *form);
        let all = || FORMS.map(|(name, _)| name).join(", ");
        named.ok_or_else(|| Error::Usage(format!("projections are {}, not {text:?}", all())))
    }
}

impl Form {
    /// The name of its need of kernels.
    pub fn need(self) -> &'static str {
        match self {
            Self::Perspective => "lens-perspective",
            Self::Fisheye => "lens-fisheye",
            Self::Equirectangular => "lens-equirectangular",
        }
    }
}

/// A lens that is no pinhole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Optics {
    /// The first step.
    pub form: Form,
    /// k1 to k4, the radial numerator's coefficients of r², r⁴, r⁶ and r⁸.
    radial: [f64; 4],
    /// k5 to k7, the radial denominator's coefficients of r², r⁴ and r⁶.
    under: [f64; 3],
    /// p1 and p2, the tangential coefficients.
    tangential: [f64; 2],
    /// s1 and s2, the thin prism's coefficients.
    prism: [f64; 2],
    /// A factor on X and Y before a fisheye's angle is taken: 1, but for the FOV model.
    wide: f64,
    /// Whether depth is camera-space z although the first step is a fisheye's: the FOV model.
    is_flat: bool,
    per_focal: f64,
    limit: f64,
    sure: f64,
    reach: f64,
}

/// A point as a lens sees it, with the first derivatives at it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// The point of the plane, in focal lengths.
    pub plane: DVec2,
    /// The depth of the point, the unit of its coordinates.
    pub depth: f64,
    /// The radius before the distortion, in focal lengths; 0 for a whole sphere.
    pub radius: f64,
    /// The depth times the change of [`Self::plane`] per unit of length along each axis of camera
    /// space.
    pub steps: [DVec3; 2],
    /// The change of the depth per unit of length along each axis.
    pub axis: DVec3,
}

/// How far beyond the border of the image splats are drawn: this factor on its distance from the
/// axis, and pixels.
const BEYOND: f64 = 1.1;
const MARGIN: f64 = 8.0;

/// Steps of the search for the limit of a lens.
const STEPS: usize = 4096;

/// The largest angle from the axis that a perspective shows, radians: 89.9 degrees.
const WIDEST: f64 = 89.9 * PI / 180.0;

impl Optics {
    /// A lens without distortion.
    pub fn of(form: Form) -> Self {
        let (radial, under, tangential, prism) = ([0.0; 4], [0.0; 3], [0.0; 2], [0.0; 2]);
        let (wide, is_flat, per_focal, limit, sure, reach) = (1.0, false, 1.0, 0.0, 0.0, 0.0);
        Self { form, radial, under, tangential, prism, wide, is_flat, per_focal, limit, sure, reach }.limited()
    }

    /// This lens with the radial numerator's coefficients k1 to k4.
    #[must_use]
    pub fn with_radial(self, radial: [f64; 4]) -> Self {
        Self { radial, ..self }.limited()
    }

    /// This lens with the radial denominator's coefficients k5 to k7.
    #[must_use]
    pub fn with_denominator(self, under: [f64; 3]) -> Self {
        Self { under, ..self }.limited()
    }

    /// This lens with the tangential coefficients p1 and p2.
    #[must_use]
    pub fn with_tangential(self, tangential: [f64; 2]) -> Self {
        Self { tangential, ..self }.limited()
    }

    /// This lens with the thin prism's coefficients s1 and s2.
    #[must_use]
    pub fn with_prism(self, prism: [f64; 2]) -> Self {
        Self { prism, ..self }.limited()
    }

    /// The FOV model (Devernay and Faugeras 2001) with the angle `omega`, radians, between 0 and
    /// pi: a fisheye whose angle is that of (wide X, wide Y, Z) with `wide = 2 tan(omega / 2)`, and
    /// whose focal lengths are those of the model divided by omega. It shows what lies in front of
    /// the eye, and depth is camera-space z.
    pub fn field_of_view(omega: f64) -> Self {
        let wide = 2.0 * (0.5 * omega).tan();
        Self { wide, is_flat: true, per_focal: omega, ..Self::of(Form::Fisheye) }.limited()
    }

    /// The factor from the focal lengths of this lens to those of its model: 1, but for the FOV
    /// model.
    pub fn per_focal(&self) -> f64 {
        self.per_focal
    }

    /// Whether depth is the distance from the eye instead of camera-space z.
    pub fn depth_is_distance(&self) -> bool {
        self.form != Form::Perspective && !self.is_flat
    }

    /// Whether the lens bends nothing: a perspective without distortion, which is a pinhole.
    pub fn is_pinhole(&self) -> bool {
        let coefficients = self.radial.iter().chain(&self.under).chain(&self.tangential).chain(&self.prism);
        self.form == Form::Perspective && coefficients.into_iter().all(|k| *k == 0.0)
    }

    /// Whether all numbers are finite and the lens shows something.
    pub fn is_usable(&self) -> bool {
        let all = self.radial.iter().chain(&self.under).chain(&self.tangential).chain(&self.prism);
        all.into_iter().chain([&self.wide]).all(|k| k.is_finite() && k.abs() < 1e9)
            && self.wide > 0.0
            && self.limit > 0.0
    }

    /// The largest radius before the distortion that the lens shows, in focal lengths; infinite for
    /// a whole sphere.
    pub fn limit(&self) -> f64 {
        self.limit
    }

    /// All coefficients for the device: k1 to k4, k5 to k7 with the widening, p1 p2 s1 s2.
    pub fn coefficients(&self) -> [[f64; 4]; 3] {
        let ([k5, k6, k7], [p1, p2], [s1, s2]) = (self.under, self.tangential, self.prism);
        [self.radial, [k5, k6, k7, self.wide], [p1, p2, s1, s2]]
    }

    fn limited(self) -> Self {
        let end = match self.form {
            Form::Equirectangular => {
                let all = f64::INFINITY;
                return Self { limit: all, sure: all, reach: all, ..self };
            }
            Form::Fisheye if self.is_flat => (self.wide * WIDEST.tan()).atan(),
            Form::Fisheye => PI,
            Form::Perspective => WIDEST,
        };
        // Equal steps of the angle.
        let radius = |step: f64| match self.form {
            Form::Perspective => (end * step / STEPS as f64).tan(),
            _ => end * step / STEPS as f64,
        };
        let grows = |r: f64| {
            let (factor, change) = self.radial_at(r * r);
            factor + 2.0 * r * r * change > 0.0
        };
        let first = (0..=STEPS).find(|step| !grows(radius(*step as f64)));
        let limit = match first {
            None => radius(STEPS as f64),
            Some(0) => 0.0,
            Some(step) => {
                let (mut low, mut high) = ((step - 1) as f64, step as f64);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    if grows(radius(middle)) { low = middle } else { high = middle }
                }
                radius(low)
            }
        };
        Self { limit, sure: Self { limit, ..self }.surely(), reach: limit, ..self }
    }

    /// This lens in a camera whose image has a border through these points of the plane, and pixels
    /// of this size, in focal lengths: splats are drawn up to a tenth and eight pixels farther out
    /// ([`Self::reach`]).
    #[must_use]
    pub fn within(self, border: impl IntoIterator<Item = DVec2>, pixel: f64) -> Self {
        if self.form == Form::Equirectangular {
            return self;
        }
        let radius = |at: DVec2| {
            let at = at * BEYOND + at.normalize_or_zero() * (MARGIN * pixel);
            self.seen_at(at).map_or(self.limit, DVec2::length)
        };
        let reach = border.into_iter().map(radius).fold(0.0, f64::max);
        Self { reach: reach.min(self.limit), ..self }
    }

    /// The largest radius before the distortion at which the centre of a splat is drawn. Beyond the
    /// image a lens may be bent so much that the straight image of a splat has nothing in common
    /// with it.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Whether a point of a segment in camera space lies within [`Self::reach`]. Not for a whole
    /// sphere.
    pub fn is_near_segment(&self, a: DVec3, b: DVec3) -> bool {
        // Directions within the reach are a cone around the axis.
        let cosine = match self.form {
            Form::Perspective => self.reach.atan().cos(),
            _ => self.reach.min(PI).cos(),
        };
        let widened = |p: DVec3| DVec3::new(self.wide * p.x, self.wide * p.y, p.z);
        let (a, along) = (widened(a), widened(b) - widened(a));
        // Where z / |p| is largest along the segment: a zero of its derivative, which is linear.
        let share = (along.z * a.length_squared() - a.z * a.dot(along))
            / (a.z * along.length_squared() - along.z * a.dot(along));
        let inner = if share > 0.0 && share < 1.0 { share } else { 0.0 };
        [0.0, inner, 1.0].into_iter().map(|share| a + share * along).any(|p| p.z >= cosine * p.length())
    }

    /// The radius, at most [`Self::limit`], that the radial part maps to `wanted`.
    fn radius_of(&self, wanted: f64) -> f64 {
        let reached = |r: f64| r * self.radial_at(r * r).0;
        let (mut low, mut high) = (0.0, self.limit);
        for _ in 0..64 {
            let middle = 0.5 * (low + high);
            if reached(middle) < wanted { low = middle } else { high = middle }
        }
        high
    }

    /// The factor of the radial part at a squared radius, and its change per unit of that.
    fn radial_at(&self, r2: f64) -> (f64, f64) {
        let ([k1, k2, k3, k4], [k5, k6, k7]) = (self.radial, self.under);
        let over = 1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)));
        let under = 1.0 + r2 * (k5 + r2 * (k6 + r2 * k7));
        let over_slope = k1 + r2 * (2.0 * k2 + r2 * (3.0 * k3 + r2 * 4.0 * k4));
        let under_slope = k5 + r2 * (2.0 * k6 + r2 * 3.0 * k7);
        if under <= 0.0 {
            return (0.0, f64::NEG_INFINITY);
        }
        let factor = over / under;
        (factor, (over_slope - factor * under_slope) / under)
    }

    /// The second step, and its derivative.
    fn distorted(&self, e: DVec2) -> (DVec2, DMat2) {
        let r2 = e.length_squared();
        let (factor, change) = self.radial_at(r2);
        let ([p1, p2], [s1, s2], DVec2 { x, y }) = (self.tangential, self.prism, e);
        let value = e * factor
            + DVec2::new(
                2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + s1 * r2,
                2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y) + s2 * r2,
            );
        let (across, down) = (
            DVec2::new(
                factor + 2.0 * change * x * x + 2.0 * p1 * y + 6.0 * p2 * x + 2.0 * s1 * x,
                2.0 * change * x * y + 2.0 * p1 * x + 2.0 * p2 * y + 2.0 * s1 * y,
            ),
            DVec2::new(
                2.0 * change * x * y + 2.0 * p2 * y + 2.0 * p1 * x + 2.0 * s2 * x,
                factor + 2.0 * change * y * y + 2.0 * p2 * x + 6.0 * p1 * y + 2.0 * s2 * y,
            ),
        );
        (value, DMat2::from_cols(across, down).transpose())
    }

    /// A point of camera space as the lens sees it; `None` if it does not.
    pub fn see(&self, p: DVec3) -> Option<Sight> {
        let (e, depth, steps, axis) = match self.form {
            Form::Perspective => perspective(p)?,
            Form::Fisheye if self.is_flat => flat(fisheye(p, self.wide)?, p)?,
            Form::Fisheye => fisheye(p, self.wide)?,
            Form::Equirectangular => return sphere(p),
        };
        // Comparisons with NaN are false.
        let is_within = e.length() <= self.limit;
        if !is_within {
            return None;
        }
        let (plane, slope) = self.distorted(e);
        let rows = [slope.row(0), slope.row(1)].map(|row| steps[0] * row.x + steps[1] * row.y);
        (slope.determinant() > 0.0 && plane.is_finite()).then_some(Sight {
            plane,
            depth,
            radius: e.length(),
            steps: rows,
            axis,
        })
    }
}

/// The first step of a point, its depth, the depth times the step's change, and the depth's.
type First = (DVec2, f64, [DVec3; 2], DVec3);

fn perspective(p: DVec3) -> Option<First> {
    let e = p.truncate() / p.z;
    (p.z > 0.0).then_some((e, p.z, [DVec3::new(1.0, 0.0, -e.x), DVec3::new(0.0, 1.0, -e.y)], DVec3::Z))
}

fn fisheye(p: DVec3, wide: f64) -> Option<First> {
    let (across, depth) = (p.truncate() * wide, p.length());
    let r = across.length();
    let (far, angle) = (r.hypot(p.z), r.atan2(p.z));
    // Straight ahead, all directions of (X, Y) are alike.
    let is_ahead = r <= 1e-12 * far && p.z > 0.0;
    let toward = if is_ahead { DVec2::X } else { across / r };
    let turned = if is_ahead { 1.0 / far } else { angle / r };
    let outward = (toward * p.z * wide).extend(-r) / (far * far);
    let around = (toward.perp() * turned * wide).extend(0.0);
    let row = |k: usize| (outward * toward[k] + around * toward.perp()[k]) * depth;
    (far > 0.0 && (is_ahead || r > 0.0)).then_some((toward * angle, depth, [row(0), row(1)], p / depth))
}

/// The first step of a fisheye with the depth camera-space z.
fn flat((at, depth, steps, _): First, p: DVec3) -> Option<First> {
    (p.z > 0.0).then_some((at, p.z, steps.map(|step| step * (p.z / depth)), DVec3::Z))
}

fn sphere(p: DVec3) -> Option<Sight> {
    let (level, depth) = (p.x.hypot(p.z), p.length());
    let plane = DVec2::new(p.x.atan2(p.z), p.y.atan2(level));
    let east = DVec3::new(p.z, 0.0, -p.x) * (depth / (level * level));
    let down = DVec3::new(-p.y * p.x / level, level, -p.y * p.z / level) / depth;
    let seen = Sight { plane, depth, radius: 0.0, steps: [east, down], axis: p / depth };
    (level > 0.0).then_some(seen)
}
