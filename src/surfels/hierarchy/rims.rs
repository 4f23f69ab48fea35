//! Bounds how far surfels and child nodes reach when they are projected onto a node's plane or cap.

use std::f64::consts::{PI, SQRT_2};

use glam::{DMat2, DVec2, DVec3};

use super::NodeBounds;
use super::below::Disk;
use super::curvature;
use super::sums::normal_of;
use crate::scene::hierarchy::Node;
use crate::scene::{Cap, Surfel};
use crate::surfels::eigen::Symmetric3;
use crate::surfels::sizes::shape;

/// Half-axes and radii are enlarged by this factor, so that rounding to f32 cannot shrink them.
pub(super) const ROUNDED_UP: f64 = 1.0 + 1.0 / (1u64 << 21) as f64;

/// A cheap bound is enlarged by this factor, as it rounds differently from the exact one.
const ROUNDED: f64 = 1.0 + 1e-14;

/// Cosine and sine of the angle by which cones are widened, 0.001 radians: near 1 a cosine
/// determines its angle poorly.
const ROUNDED_ANGLE: DVec2 = DVec2::new(1.0 - 5e-7, 1e-3);

/// Added to the tangent of a cone's angle, because near 1 a cosine determines its angle poorly, and
/// because a node's normal is rounded.
const TURNED_MORE: f64 = 2e-3;

/// Subtracted from a cosine before it is rounded to f32.
const ROUNDED_OFF: f64 = 1e-7;

/// A disk is also projected along its own normal. If that normal leans from the node's normal by a
/// larger tangent than this (76 degrees), a direction between both with this tangent is used.
const STEEPEST: f64 = 4.0;

/// The orientation and the aspect ratio of an ellipse: two vectors along its half-axes in a node's
/// plane, the longer one of length 1.
#[derive(Clone, Copy)]
pub(super) struct Shape {
    pub s: DVec3,
    pub t: DVec3,
    /// The dot products of a vector with these are its (u, v), in units of `s` and `t`.
    pub seen: [DVec3; 2],
}

impl Shape {
    /// The shape of the covariance projected onto the plane of `normal` (EQ 3, 5), rounded to f32.
    ///
    /// The covariance is that of the disks. With that of the centres, as in the paper, two disks
    /// side by side would get an ellipse several times as long as both.
    pub fn of(covariance: Symmetric3, normal: DVec3) -> Self {
        let (e1, e2) = normal.any_orthonormal_pair();
        let plane = [e1.dot(covariance.times(e1)), e1.dot(covariance.times(e2)), e2.dot(covariance.times(e2))];
        let ([x, y], slimness) = shape(plane).unwrap_or(([1.0, 0.0], 1.0));
        let s = e1 * x + e2 * y;
        let rounded = |v: DVec3| v.as_vec3().as_dvec3();
        let (s, t) = (rounded(s), rounded(normal.cross(s) * slimness));
        Self { s, t, seen: [s, t].map(|axis| axis / axis.length_squared()) }
    }

    /// An upper bound of |(u, v)| / |vector|: it is largest along the shorter half-axis, which is
    /// perpendicular to the longer one up to f32 rounding.
    pub fn scale(&self) -> f64 {
        let [s, t] = self.seen.map(DVec3::length);
        s.max(t) * ROUNDED_UP
    }

    /// The (u, v) of a vector.
    pub fn seen(&self, vector: DVec3) -> DVec2 {
        DVec2::from_array(self.seen.map(|axis| vector.dot(axis)))
    }
}

/// The curvature of a node, as heights over the plane of two unit directions.
#[derive(Clone, Copy)]
pub(super) struct Curve {
    along: DVec3,
    across: DVec3,
    heights: DMat2,
    /// The largest absolute curvature, 1 / world unit.
    most: f64,
}

impl Curve {
    pub fn of(heights: curvature::Heights, [along, across, _]: [DVec3; 3]) -> Self {
        let [xx, xy, yy] = heights;
        let most = 0.5 * (xx + yy).abs() + length(0.5 * (xx - yy), xy);
        Self { along, across, heights: curvature::matrix(heights), most }
    }

    /// The components of `vector` along the two directions.
    fn in_plane(&self, vector: DVec3) -> DVec2 {
        DVec2::new(vector.dot(self.along), vector.dot(self.across))
    }

    /// The height over the plane at `place`, and its gradient.
    fn at(&self, place: DVec2) -> (f64, DVec2) {
        let slope = self.heights * place;
        (0.5 * slope.dot(place), slope)
    }
}

/// Bounds over a set of surfels.
#[derive(Clone, Copy)]
pub(super) struct Bound {
    /// The largest |(u, v)| of a disk's rim, projected onto the node's cap along the node's normal
    /// and along the disk's own.
    pub rim: f64,
    /// The largest distance of a point from the node's centre, world units.
    pub radius: f64,
    /// The smallest cosine of the angle between a normal and the node's.
    pub cosine: f64,
}

impl Bound {
    pub const NOTHING: Self = Self { rim: 0.0, radius: 0.0, cosine: 1.0 };
    /// The weakest bounds, which hold for any set.
    pub const ALL: Self = Self { rim: f64::INFINITY, radius: f64::INFINITY, cosine: -1.0 };

    pub fn both(self, other: Self) -> Self {
        Self {
            rim: self.rim.max(other.rim),
            radius: self.radius.max(other.radius),
            cosine: self.cosine.min(other.cosine),
        }
    }
}

/// The length of a 2D vector whose squares neither overflow nor underflow.
fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// The longer half-axis of the ellipse s cos φ + t sin φ, from the products [s·s, s·t, t·t]: the
/// larger singular value of [s t].
pub(super) fn longest([ss, st, tt]: [f64; 3]) -> f64 {
    (0.5 * (ss + tt + length(ss - tt, 2.0 * st))).sqrt()
}

/// The largest distance from 0 to a point of the ellipse `at + u cos φ + v sin φ`, or hardly more.
///
/// Its square is the maximum of `|a + M w|²` over the unit circle. By duality, this is the minimum
/// of `λ + Σ b_i² / (λ - λ_i) + |a|²` over λ > λ_1. Here λ_i are the eigenvalues of `MᵀM`, largest
/// first, and b is `Mᵀa` along its eigenvectors. Any such λ gives an upper bound; the tightest is
/// where the derivative is 0.
fn farthest(at: DVec2, [u, v]: [DVec2; 2]) -> f64 {
    let (uu, uv, vv) = (u.dot(u), u.dot(v), v.dot(v));
    let (mean, half) = (0.5 * (uu + vv), length(0.5 * (uu - vv), uv));
    let [first, second] = [mean + half, mean - half];
    // Both vectors are along the eigenvector; the longer one has lost no digits to cancellation.
    // For a circle any direction is an eigenvector.
    let (one, other) = (DVec2::new(first - vv, uv), DVec2::new(uv, first - uu));
    let longer = if one.length_squared() > other.length_squared() { one } else { other };
    let axis = longer.try_normalize().unwrap_or(DVec2::X);
    let b = DVec2::new(u.dot(at), v.dot(at));
    let b = DVec2::new(b.dot(axis), b.perp_dot(axis));
    let (b1, b2) = (b.x * b.x, b.y * b.y);
    // Two Newton steps toward the root of the derivative, from above the root.
    let least = first + b.x.abs();
    let mut lambda = first + b.length();
    for _ in 0..2 {
        let [p, q] = [lambda - first, lambda - second];
        let [square, cube] = [b1 / (p * p) + b2 / (q * q), b1 / (p * p * p) + b2 / (q * q * q)];
        let step = (square.sqrt() - 1.0) * square / cube;
        lambda = if step.is_finite() { (lambda + step).max(least) } else { lambda };
    }
    let part = |b: f64, rest: f64| if b > 0.0 { b / rest } else { 0.0 };
    let squared = lambda + part(b1, lambda - first) + part(b2, lambda - second) + at.length_squared();
    // If rounding leaves no finite value, use the bound for a circle around the ellipse.
    if squared.is_finite() { squared.sqrt() } else { at.length() + first.sqrt() }
}

/// A node whose bounds are being computed.
pub(super) struct Bounding {
    pub center: DVec3,
    pub normal: DVec3,
    pub shape: Shape,
    pub curve: Curve,
    /// [`Shape::scale`].
    pub scale: f64,
    pub bounds: NodeBounds,
}

impl Bounding {
    /// Bounds one surfel, whose bounds are known to lie within `most`. Bounds that cannot exceed
    /// those in `known` are skipped: the result has 0, or for the cosine 1, instead.
    pub fn of(&self, disk: &Disk, known: &Bound, most: &Bound) -> Bound {
        let Disk { surfel, center, cap } = disk;
        let own = normal_of(surfel);
        let mut bound = Bound::NOTHING;
        if most.rim > known.rim {
            bound.rim = match self.bounds {
                NodeBounds::Rims => self.rim(disk, own, known.rim),
                NodeBounds::Squares | NodeBounds::Cones => self.corner(disk),
            };
        }
        if most.radius > known.radius {
            let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
            let products = [s.dot(s), s.dot(t), t.dot(t)];
            let reach = |longest: f64| center.distance(self.center) + longest + cap.highest();
            let matters = reach((products[0] + products[2]).sqrt() * ROUNDED) > known.radius;
            bound.radius = if matters { reach(longest(products)) } else { 0.0 };
        }
        if most.cosine < known.cosine {
            let cosine = own.dot(self.normal).clamp(-1.0, 1.0);
            bound.cosine = match tilt(surfel, cap) {
                0.0 => cosine,
                tilt => (cosine.acos() + tilt).min(PI).cos(),
            };
        }
        bound
    }

    /// The largest |(u, v)| of a corner of the square about a disk, projected along the node's
    /// normal.
    fn corner(&self, Disk { surfel, center, .. }: &Disk) -> f64 {
        let [s, t] = [surfel.s, surfel.t].map(|axis| self.shape.seen(DVec3::from_array(axis.map(f64::from))));
        let at = self.shape.seen(center - self.center);
        [at + s + t, at + s - t, at - s + t, at - s - t].map(DVec2::length).into_iter().fold(0.0, f64::max)
    }

    /// The [`Bound::rim`] of a surfel with the unit normal `own`. If it does not exceed `known`,
    /// any smaller value may be returned.
    fn rim(&self, Disk { surfel, center, cap }: &Disk, own: DVec3, known: f64) -> f64 {
        let offset = center - self.center;
        let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
        let height = cap.highest();
        let across = self.leaning(own);
        let (over, slope) = self.curve.at(self.curve.in_plane(offset));
        // The dot product of a vector with `higher` is how much higher its end lies over the node's
        // cap than its start, up to `bend`.
        let higher = self.normal - slope.x * self.curve.along - slope.y * self.curve.across;
        let bend = 0.5 * self.curve.most * s.length_squared().max(t.length_squared());
        let places = [offset, s, t, own * height].map(|vector| self.shape.seen(vector));
        let above = [offset.dot(self.normal) - over, s.dot(higher), t.dot(higher), height * own.dot(higher)];
        [DVec2::ZERO, across].into_iter().fold(0.0, |rim: f64, across| {
            let [at, u, v, lean] = [0, 1, 2, 3].map(|k| places[k] - across * above[k]);
            // The disk's own cap may reach beside the rim by its height, and `bend` may shift the
            // projection.
            let lean = lean.length() + across.length() * bend;
            let matters = |reach: f64| at.length() + reach + lean > known.max(rim);
            let products = [u.dot(u), u.dot(v), v.dot(v)];
            // Cheapest first: a circle of radius sqrt(|u|² + |v|²), then the circle around the
            // projected disk.
            if !matters((products[0] + products[2]).sqrt() * ROUNDED) || !matters(longest(products)) {
                return rim;
            }
            rim.max((at.length() + longest(products)).min(farthest(at, [u, v])) + lean)
        })
    }

    /// How far a point moves in (u, v), for each unit of height over the node's cap, if it is
    /// projected along the normal `own` instead of the node's.
    ///
    /// With projections along the nodes' normals alone, neighbouring nodes whose planes bend away
    /// from each other would leave a gap in oblique views: one ends directly above or below the end
    /// of the other. With projections along the disks' normals too, which are those of the surface,
    /// both nodes reach the line in which their planes meet.
    fn leaning(&self, own: DVec3) -> DVec2 {
        let up = own.dot(self.normal);
        let beside = (own - up * self.normal) * up.signum();
        let most = STEEPEST / beside.length();
        let slope = if up.abs() * most > 1.0 { up.abs().recip() } else { most };
        if slope.is_finite() { self.shape.seen(beside * slope) } else { DVec2::ZERO }
    }

    /// Bounds all surfels below a node by the node's own sphere and cone; these bounds are not
    /// tight.
    pub fn of_node(&self, node: &Node, low: [f32; 3]) -> Bound {
        let [center, low] = [node.surfel.center, low].map(|part| DVec3::from_array(part.map(f64::from)));
        let offset = center + low - self.center;
        let wider = if self.bounds.of_squares() { SQRT_2 } else { 1.0 };
        let radius = f64::from(node.radius) * wider * ROUNDED_UP;
        // Cosine and sine of three angles: `angle` between the two normals, `angles` with the cone
        // added, and `turned` with the rounding margin added too.
        let turned = |by: DVec2, cosine: f64| by.rotate(DVec2::new(cosine, (1.0 - cosine * cosine).max(0.0).sqrt()));
        let angle = turned(DVec2::X, normal_of(&node.surfel).dot(self.normal).clamp(-1.0, 1.0));
        let angles = turned(angle, f64::from(node.cone).clamp(-1.0, 1.0));
        let turned = ROUNDED_ANGLE.rotate(angles);
        // A sum of angles beyond 180 degrees has a negative sine, before or after the margin is
        // added. A full cone counts as such a sum too.
        let beyond = node.cone <= -1.0 || angles.y < 0.0 || turned.y < 0.0;
        let slope = if !beyond && turned.y < STEEPEST * turned.x { turned.y / turned.x } else { STEEPEST };
        let at = self.shape.seen(offset);
        let place = self.curve.in_plane(offset);
        let (over, gain) = self.curve.at(place);
        let above = offset.dot(self.normal) - over;
        // How much the height over the node's cap changes within the sphere of the child.
        let around = radius * (1.0 + gain.length()) + 2.0 * self.curve.most * radius * radius;
        let high = above.abs() + around;
        let mut rim = at.length() + (radius + slope * high) * self.scale;
        if !beyond && turned.x > 0.0 && node.cone > 0.0 {
            // A tighter bound, around the child's projection along its own normal. For each radian
            // that a normal turns, `leaning` changes by at most `changes`; the tangent of an angle
            // exceeds the angle.
            let changes = (turned.x * turned.x).recip().min(1.0 + STEEPEST * STEEPEST);
            let most = changes * ((f64::from(node.cone).powi(-2) - 1.0).max(0.0).sqrt() + TURNED_MORE);
            let own = (angle.y / angle.x).min(STEEPEST);
            let leaning = (at - self.leaning(normal_of(&node.surfel)) * above).length();
            let leaning = leaning + (radius + own * around + most * high) * self.scale;
            rim = rim.min(leaning.max(at.length() + radius * self.scale));
        }
        Bound {
            rim: rim * ROUNDED_UP,
            radius: (offset.length() + radius) * ROUNDED_UP,
            cosine: if beyond { -1.0 } else { turned.x },
        }
    }
}

/// An upper bound of the angle between the normals of a surfel's cap and of its plane, radians; 0
/// for a flat surfel.
pub(super) fn tilt(surfel: &Surfel, cap: &Cap) -> f64 {
    if cap.is_flat() {
        return 0.0;
    }
    let [uu, uv, vv] = cap.0.map(|height| f64::from(height).abs());
    let length = |axis: [f32; 3]| DVec3::from_array(axis.map(f64::from)).length();
    ((uu + uv) / length(surfel.s)).hypot((uv + vv) / length(surfel.t)).atan()
}

/// The [`Node::cone`] for this smallest cosine; -1 where normals have no side.
pub(super) fn cone(sided: bool, cosine: f64) -> f32 {
    if sided { (cosine - ROUNDED_OFF) as f32 } else { -1.0 }
}

#[cfg(test)]
mod tests;
