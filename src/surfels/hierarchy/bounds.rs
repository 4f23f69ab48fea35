//! What a node shows and holds: its ellipse, its sphere and its cone of normals (Pajarola 2003, sections 3.2 and 3.4).

use std::f64::consts::PI;
use std::ops::Range;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::lattice::Lattice;
use super::sums::{Scales, Sums, normal_of};
use crate::scene::hierarchy::Node;
use crate::scene::{Cap, Scene, Surfel};
use crate::surfels::eigen::Symmetric3;
use crate::surfels::sizes::shape;

/// Surfels of a node whose bounds are made by all threads.
const MANY: usize = 1 << 14;

/// What half-axes and radii are longer by than was found, as they are rounded to f32.
const ROUNDED_UP: f64 = 1.0 + 1.0 / (1u64 << 21) as f64;

/// What is rounded off a cosine.
const ROUNDED_OFF: f64 = 1e-7;

/// A direction and a shape: vectors of the plane across a normal, of which the second is `slimness` as long as the first.
#[derive(Clone, Copy)]
struct Shape {
    s: DVec3,
    t: DVec3,
    /// What a vector's dot products with these are is its (u, v), in units of the half-axes.
    seen: [DVec3; 2],
}

impl Shape {
    /// Like the covariance in the plane (EQ 3, 5), with what f32 keeps of it. Of the centres alone, as in the paper, two disks side by side would
    /// get an ellipse several times as long as both.
    fn of(covariance: Symmetric3, normal: DVec3) -> Self {
        let (e1, e2) = normal.any_orthonormal_pair();
        let Symmetric3 { xx, yy, zz, xy, xz, yz } = covariance;
        let columns = |v: DVec3| {
            let [x, y, z] = v.to_array();
            DVec3::new(xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z)
        };
        let plane = [e1.dot(columns(e1)), e1.dot(columns(e2)), e2.dot(columns(e2))];
        let ([x, y], slimness) = shape(plane).unwrap_or(([1.0, 0.0], 1.0));
        let s = e1 * x + e2 * y;
        let rounded = |v: DVec3| v.as_vec3().as_dvec3();
        let (s, t) = (rounded(s), rounded(normal.cross(s) * slimness));
        Self { s, t, seen: [s, t].map(|axis| axis / axis.length_squared()) }
    }

    /// (u, v) of a vector.
    fn seen(&self, vector: DVec3) -> DVec2 {
        DVec2::from_array(self.seen.map(|axis| vector.dot(axis)))
    }
}

/// What bounds surfels so far.
#[derive(Clone, Copy)]
struct Bound {
    /// The largest u² + v² of a corner.
    squared: f64,
    /// The largest distance from the centre.
    radius: f64,
    /// The smallest cosine.
    cosine: f64,
}

impl Bound {
    const NOTHING: Self = Self { squared: 0.0, radius: 0.0, cosine: 1.0 };

    fn both(self, other: Self) -> Self {
        Self {
            squared: self.squared.max(other.squared),
            radius: self.radius.max(other.radius),
            cosine: self.cosine.min(other.cosine),
        }
    }

    /// That of one surfel.
    fn of(scene: &Scene, index: usize, (center, normal): (DVec3, DVec3), shape: &Shape) -> Self {
        let surfel = &scene.surfels[index];
        let offset = scene.center(index) - center;
        let [s, t] = [surfel.s, surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
        let own = normal_of(surfel);
        let height = scene.caps.get(index).map_or(0.0, Cap::highest);
        let [at, s_seen, t_seen] = [offset, s, t].map(|vector| shape.seen(vector));
        // A cap leans out as far as it is high.
        let lean = shape.seen(own * height).abs();
        let corner = |s: DVec2, t: DVec2| ((at + s + t).abs() + lean).length_squared();
        let corners =
            [corner(s_seen, t_seen), corner(s_seen, -t_seen), corner(-s_seen, t_seen), corner(-s_seen, -t_seen)];
        Self {
            squared: corners.into_iter().fold(0.0, f64::max),
            radius: offset.length() + s.length_squared().max(t.length_squared()).sqrt() + height,
            cosine: (own.dot(normal).clamp(-1.0, 1.0).acos() + tilt(scene, index)).min(PI).cos(),
        }
    }
}

/// The largest angle between the normals of a surfel's cap and that of its plane, or more: 0 of a flat one.
fn tilt(scene: &Scene, index: usize) -> f64 {
    let Some(Cap(heights)) = scene.caps.get(index).filter(|cap| !cap.is_flat()) else { return 0.0 };
    let [uu, uv, vv] = heights.map(|height| f64::from(height).abs());
    let [s, t] = [scene.surfels[index].s, scene.surfels[index].t];
    let length = |axis: [f32; 3]| DVec3::from_array(axis.map(f64::from)).length();
    ((uu + uv) / length(s)).hypot((uv + vv) / length(t)).atan()
}

/// The node of the surfels of a range of `scene`, with these sums on their lattice; what its f32 centre leaves out comes second.
pub(super) fn node(
    scene: &Scene,
    range: Range<usize>,
    sums: &Sums,
    lattice: &Lattice,
    scale: &Scales,
) -> (Node, [f32; 3]) {
    let color = sums.color(scale);
    let (first, count) = (range.start as u32, range.len() as u32);
    let (normal, sided) = sums.normal(scene.oriented);
    let cone = |cosine: f64| if sided { (cosine - ROUNDED_OFF) as f32 } else { -1.0 };
    if range.len() == 1 {
        let surfel = scene.surfels[range.start];
        let low = scene.low.get(range.start).copied().unwrap_or_default();
        let height = scene.caps.get(range.start).map_or(0.0, Cap::highest);
        let radius = ((f64::from(surfel.radius()) + height) * ROUNDED_UP) as f32;
        return (
            Node { surfel, color, radius, cone: cone(tilt(scene, range.start).cos()), first, count, leaf: true },
            low,
        );
    }
    let mean = lattice.position(sums.moments.mean());
    // As a file in world coordinates has it, so that what is read back is the same.
    let mean = (scene.origin + mean) - scene.origin;
    let rounded = ((scene.origin + mean.as_vec3().as_dvec3()) - scene.origin).as_vec3();
    let low = if scene.low.is_empty() { DVec3::ZERO } else { mean - rounded.as_dvec3() }.as_vec3();
    let center = rounded.as_dvec3() + low.as_dvec3();
    let shape = Shape::of(sums.covariance(lattice, scale), normal);
    // As what is stored has it.
    let stored = shape.s.cross(shape.t).normalize();
    let bound = |index: usize| Bound::of(scene, index, (center, stored), &shape);
    let all = if range.len() > MANY {
        range.into_par_iter().with_min_len(4096).map(bound).reduce(|| Bound::NOTHING, Bound::both)
    } else {
        range.map(bound).fold(Bound::NOTHING, Bound::both)
    };
    let factor = all.squared.sqrt() * ROUNDED_UP;
    let [s, t] = [shape.s, shape.t].map(|axis| (axis * factor).as_vec3().to_array());
    let surfel = Surfel { center: rounded.to_array(), s, t };
    let radius = (all.radius.max(factor) * ROUNDED_UP) as f32;
    (Node { surfel, color, radius, cone: cone(all.cosine), first, count, leaf: true }, low.to_array())
}
