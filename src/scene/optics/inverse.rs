//! From a point of the plane back to its ray, and where the image of a lens ends.
//!
//! The lens shows the image of all points up to [`Optics::limit`] before the distortion. If the
//! distortion is radial, that image is a disk. Tangential and prism terms shift its border, so a
//! point of the plane then belongs to the image if Newton's method finds what the distortion maps
//! to it. Points within [`Optics::sure`] need no such search.

use super::{DVec2, DVec3, Form, Optics, PI, TAU};

/// Rounds of Newton's method for the tangential part of a distortion.
const ROUNDS: usize = 12;

/// The largest distance, in focal lengths at a distance of 0 from the axis, at which a point counts
/// as found. Kernels compute in f32.
const FOUND: f64 = 1e-4;

/// Directions, and steps along each, in which the border of the image is searched.
const DIRECTIONS: usize = 64;
const STEPS: usize = 512;

/// The part of the least radius of the border, in the directions searched, that counts as sure.
const SURE: f64 = 0.95;

impl Optics {
    /// The radius of the plane, in focal lengths, within which the lens surely shows each point;
    /// with a radial distortion it shows nothing beyond.
    pub fn sure(&self) -> f64 {
        self.sure
    }

    /// Whether there are tangential or prism terms.
    pub(super) fn leans(&self) -> bool {
        self.tangential.iter().chain(&self.prism).any(|k| *k != 0.0)
    }

    /// Whether the lens shows something at a point of the plane.
    pub fn shows(&self, plane: DVec2) -> bool {
        match self.form {
            Form::Equirectangular => plane.y.abs() <= 0.5 * PI && plane.x.abs() <= PI,
            _ => plane.length() <= self.sure || (self.leans() && self.found(plane).is_some()),
        }
    }

    /// The ray through a point of the plane: a point of depth 1 in camera space. Where the lens
    /// shows nothing, it is the ray at the border of its image in the same direction, without the
    /// tangential part.
    pub fn ray(&self, plane: DVec2) -> DVec3 {
        if self.form == Form::Equirectangular {
            let ((sine, cosine), (up, level)) = (plane.x.sin_cos(), plane.y.sin_cos());
            return DVec3::new(sine * level, up, cosine * level);
        }
        let e = self.undistorted(plane);
        let r = e.length();
        match self.form {
            Form::Perspective => e.extend(1.0),
            _ => {
                let (sine, cosine) = r.sin_cos();
                let across = if r > 0.0 { e * (sine / r / self.wide) } else { e / self.wide };
                let ray = across.extend(cosine);
                if self.is_flat { ray / ray.z } else { ray.normalize() }
            }
        }
    }

    /// The point that the second step maps to `plane`, or the one at the border of the image.
    pub(super) fn undistorted(&self, plane: DVec2) -> DVec2 {
        self.seen_at(plane).unwrap_or_else(|| self.without_lean(plane))
    }

    /// The point within the limit whose image is at `plane`; `None` where the lens shows nothing.
    pub(super) fn seen_at(&self, plane: DVec2) -> Option<DVec2> {
        match self.leans() {
            true => self.found(plane),
            false => (plane.length() <= self.sure).then(|| self.without_lean(plane)),
        }
    }

    /// The point, at most at the limit, that the radial part maps to `plane`.
    fn without_lean(&self, plane: DVec2) -> DVec2 {
        let wanted = plane.length();
        if wanted > 0.0 { plane * (self.radius_of(wanted) / wanted) } else { plane }
    }

    /// The point within the limit that the second step maps to `plane`; `None` if there is none.
    fn found(&self, plane: DVec2) -> Option<DVec2> {
        let mut e = self.without_lean(plane);
        for _ in 0..ROUNDS {
            let (value, slope) = self.distorted(e);
            e += slope.inverse() * (plane - value);
            e = e.clamp_length_max(self.limit);
        }
        // Comparisons with NaN are false.
        let off = (self.distorted(e).0 - plane).length();
        (off <= FOUND * (1.0 + plane.length())).then_some(e)
    }

    /// The radius of [`Self::sure`] for a limit that is known.
    pub(super) fn surely(&self) -> f64 {
        if !self.leans() {
            return self.limit * self.radial_at(self.limit * self.limit).0;
        }
        let angle = if self.form == Form::Perspective { self.limit.atan() } else { self.limit };
        let radius = |step: usize| {
            let at = angle * step as f64 / STEPS as f64;
            if self.form == Form::Perspective { at.tan() } else { at }
        };
        let border = |direction: usize| {
            let toward = DVec2::from_angle(TAU * direction as f64 / DIRECTIONS as f64);
            let grows = |step: &usize| self.distorted(toward * radius(*step)).1.determinant() > 0.0;
            let last = (0..=STEPS).take_while(grows).last().unwrap_or(0);
            self.distorted(toward * radius(last)).0.length()
        };
        SURE * (0..DIRECTIONS).map(border).fold(f64::INFINITY, f64::min)
    }
}
