//! The curvature of the surface below a node: the linear field of normals that is nearest to those
//! of its children or surfels, and the paraboloid with these normals.
//!
//! Pajarola 2003 (section 5.2) tilts the normals at the corners of a coarse splat outward by its
//! cone angle, as if all surfaces were convex and equally curved in every direction. The symmetric
//! matrix that is fitted here distinguishes hollows, saddles and cylinders.

use glam::{DMat2, DMat3, DVec2, DVec3};

use super::below::Below;
use super::sums::normal_of;
use crate::scene::Cap;
use crate::scene::hierarchy::FAN_OUT;
use crate::surfels::eigen::Symmetric3;

/// Slopes are normals divided by the cosine of their angle to the node's normal, or by this if it
/// is smaller: 76 degrees.
const LEAST_COSINE: f64 = 0.25;

/// Added to the diagonal of the normal equations, as a fraction of the sum of squares, because
/// points on a line do not determine the curvature across the line.
const RIDGE: f64 = 1e-3;

/// Nodes whose normals [align](super::sums::Sums::alignment) less than this are flat: the normals
/// belong to no single surface, and a cap fitted to them would shade to a speck of light. Of the
/// values from 0.7 to 0.95, this one brings pictures of the Dragon's nodes at 4 to 64 px nearest to
/// the picture of all surfels.
pub(super) const LEAST_ALIGNMENT: f64 = 0.9;

/// The heights of a plane.
pub(super) const FLAT: Heights = [0.0; 3];

/// Heights over a plane, `(xx x² + 2 xy x y + yy y²) / 2` along its normal for x and y along two of
/// its directions: [xx, xy, yy], 1 / world unit.
pub(super) type Heights = [f64; 3];

/// Fits heights to the node `of`, whose centre is `center`, over a plane given by two unit
/// directions and its normal.
pub(super) fn heights<B: Below>(of: B::Key, below: &B, center: DVec3, plane: [DVec3; 3]) -> Heights {
    let mut right_below = Vec::with_capacity(FAN_OUT);
    if below.is_leaf(of) {
        below.disks(of, |disk| right_below.push((disk.center - center, normal_of(&disk.surfel), 1.0)));
    } else {
        below.children(of, |child| {
            let node = child.node;
            let [place, low] = [node.surfel.center, child.low].map(|part| DVec3::from_array(part.map(f64::from)));
            right_below.push((place + low - center, normal_of(&node.surfel), child.surfels as f64));
        });
    }
    fitted(right_below.into_iter(), plane)
}

/// Fits heights to the children or surfels of a node: for each its offset from the node's centre,
/// its unit normal and its weight.
fn fitted(below: impl Iterator<Item = (DVec3, DVec3, f64)>, [along, across, normal]: [DVec3; 3]) -> Heights {
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let mut right = DVec3::ZERO;
    for (offset, own, weight) in below {
        let (x, y) = (offset.dot(along), offset.dot(across));
        let up = own.dot(normal);
        // A normal without a side may point either way.
        let own = own * up.signum() / up.abs().max(LEAST_COSINE);
        let slope = -DVec2::new(own.dot(along), own.dot(across));
        (xx, xy, yy) = (xx + weight * x * x, xy + weight * x * y, yy + weight * y * y);
        right += weight * DVec3::new(x * slope.x, y * slope.x + x * slope.y, y * slope.y);
    }
    let ridge = RIDGE * (xx + yy);
    let squares = DMat3::from_cols_array(&[xx + ridge, xy, 0.0, xy, xx + yy + ridge, xy, 0.0, xy, yy + ridge]);
    let heights = (squares.inverse() * right).to_array();
    if heights.iter().all(|height| height.is_finite()) { heights } else { [0.0; 3] }
}

/// The mean of `heights` over points with this covariance about the centre, world units.
///
/// It is limited to half the standard deviation of the points in the plane: where a surface is far
/// from flat, its normals do not determine heights.
pub(super) fn mean_height(heights: Heights, covariance: Symmetric3, plane: [DVec3; 3]) -> f64 {
    let spread = in_plane(covariance, plane);
    let most = 0.5 * trace(spread).max(0.0).sqrt();
    (0.5 * trace(matrix(heights) * spread)).clamp(-most, most)
}

/// A lower bound of the root mean square distance of points from a cap with these heights, along
/// its normal, world units.
///
/// The points' variance along the normal, from the covariance `all`, is reduced by `tr (H C)² / 2`.
/// This is the variance of the cap's heights H over a normal distribution with the covariance C of
/// `centers`. It exceeds the variance over a disk or a square, so the result counts no distance
/// that the cap explains. A cap that bends away from points in a plane is not detected.
pub(super) fn off_cap(heights: Heights, [all, centers]: [Symmetric3; 2], plane: [DVec3; 3]) -> f64 {
    let [.., normal] = plane;
    let shown = matrix(heights) * in_plane(centers, plane);
    (normal.dot(all.times(normal)) - 0.5 * trace(shown * shown)).max(0.0).sqrt()
}

/// The heights as a matrix over the plane's two directions.
pub(super) fn matrix([xx, xy, yy]: Heights) -> DMat2 {
    DMat2::from_cols_array(&[xx, xy, xy, yy])
}

/// The covariance projected onto the plane's two directions.
fn in_plane(covariance: Symmetric3, [along, across, _]: [DVec3; 3]) -> DMat2 {
    let of = |a: DVec3, b: DVec3| a.dot(covariance.times(b));
    matrix([of(along, along), of(along, across), of(across, across)])
}

fn trace(m: DMat2) -> f64 {
    m.x_axis.x + m.y_axis.y
}

/// The cap of a disk whose half-axes have these lengths along the plane's directions.
pub(super) fn cap([xx, xy, yy]: Heights, [s, t]: [f64; 2]) -> Cap {
    Cap([xx * s * s, xy * s * t, yy * t * t].map(|height| height as f32)).usable(s.max(t))
}

/// The cap whose normals lean outward at the rim by a cone with this cosine, at most 60 degrees, on
/// a disk whose half-axes have these lengths.
pub(super) fn cone(cosine: f64, [s, t]: [f64; 2]) -> Cap {
    let slope = (cosine.max(0.5).powi(-2) - 1.0).max(0.0).sqrt();
    Cap([-slope * s, 0.0, -slope * t].map(|height| height as f32)).usable(s.max(t))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::Vec3;

    use super::super::{NodeBounds, build, build_with};
    use super::*;
    use crate::scene::hierarchy::Node;
    use crate::scene::{Scene, Surfel};

    /// Disks on a height field, given by its height and gradient.
    fn field(height: impl Fn(f64, f64) -> (f64, DVec2), oriented: bool) -> Scene {
        let surfel = |k: usize| {
            let [x, y] = [k % 50, k / 50].map(|k| (k as f64 + 0.5) / 25.0 - 1.0);
            let (z, slope) = height(x, y);
            let side = if oriented || !k.is_multiple_of(3) { 1.0 } else { -1.0 };
            let normal = DVec3::new(-slope.x, -slope.y, 1.0) * side;
            Surfel::disk(Vec3::new(x as f32, y as f32, z as f32), normal.normalize().as_vec3(), 0.04)
        };
        Scene { surfels: (0..2500).map(surfel).collect(), oriented, ..Scene::default() }
    }

    /// The nodes of a paraboloid have its curvature, whichever way it bends and normals point;
    /// those of a plane have none.
    #[test]
    fn nodes_curve_as_the_surface_does() {
        for oriented in [true, false] {
            for [xx, xy, yy] in [[0.0; 3], [0.1, 0.0, 0.1], [-0.1, 0.0, 0.0], [0.08, 0.05, -0.06]] {
                let heights = |x: f64, y: f64| {
                    let slope = DVec2::new(xx * x + xy * y, xy * x + yy * y);
                    (0.5 * slope.dot(DVec2::new(x, y)), slope)
                };
                let (_, tree) = build(field(heights, oriented), &()).unwrap();
                let mut looked_at = 0;
                // Points on a line do not determine the curvature across it.
                let wide = |node: &&Node| node.surfel.shorter() > 0.6 * node.surfel.radius();
                for node in tree.nodes.iter().filter(|node| node.count > 3).filter(wide) {
                    let [s, t] = [node.surfel.s, node.surfel.t].map(|axis| Vec3::from_array(axis).as_dvec3());
                    let up = s.cross(t).z.signum();
                    let along =
                        |a: DVec3, b: DVec3| up * (xx * a.x * b.x + xy * (a.x * b.y + a.y * b.x) + yy * a.y * b.y);
                    let expected = [along(s, s), along(s, t), along(t, t)];
                    let most = 0.02 * s.length_squared() * 0.1 + 1e-6;
                    let off = node.cap.0.iter().zip(expected).map(|(a, b)| (f64::from(*a) - b).abs());
                    assert!(off.fold(0.0, f64::max) < most, "{:?} {expected:?} {oriented}", node.cap);
                    // The node's centre lies on the paraboloid.
                    let [x, y, z] = node.surfel.center.map(f64::from);
                    assert!(
                        (z - heights(x, y).0).abs() < 0.02 * 0.1 * s.length_squared() + 1e-6,
                        "{z} {:?}",
                        heights(x, y)
                    );
                    looked_at += 1;
                }
                assert!(looked_at > 50, "{looked_at}");
            }
        }
    }

    /// With `cones`, normals at the ends of a node's half-axes lean outward by the node's cone.
    #[test]
    fn normals_lean_by_the_cone() {
        let bowl = field(|x, y| (-0.1 * (x * x + y * y), -0.2 * DVec2::new(x, y)), true);
        let (_, tree) = build_with(bowl, NodeBounds::Cones, &()).unwrap();
        let mut looked_at = 0;
        for node in tree.nodes.iter().filter(|node| node.count > 1) {
            let lengths = [node.surfel.s, node.surfel.t].map(|axis| f64::from(Vec3::from_array(axis).length()));
            let ends = [node.cap.slope(1.0, 0.0), node.cap.slope(0.0, 1.0)];
            let leans = [-ends[0].x / lengths[0], -ends[1].y / lengths[1]].map(f64::atan);
            let cone = f64::from(node.cone).acos();
            assert!(leans.iter().all(|lean| (lean - cone).abs() < 2e-3), "{leans:?} {cone}");
            looked_at += 1;
        }
        assert!(looked_at > 50, "{looked_at}");
    }

    /// A node's radius exceeds its bounding sphere if points lie off its cap, and not if they lie
    /// in a plane or curve as the cap does.
    #[test]
    fn what_lies_off_a_cap_counts() {
        let root = |height: &dyn Fn(f64, f64) -> (f64, DVec2)| build(field(height, true), &()).unwrap().1.nodes[0];
        // The reach of the node's own ellipse and cap. It equals the reach of the surfels below the
        // node where the ellipse bounds them tightly.
        let own = |node: &Node| f64::from(node.surfel.radius()) + node.cap.highest();
        let plane = root(&|_, _| (0.0, DVec2::ZERO));
        assert!(f64::from(plane.radius) < 1.001 * own(&plane), "{} {}", plane.radius, own(&plane));
        // The points of this bowl lie 0.042 off the plane through their mean, which would enlarge
        // the radius by a factor of 1.08.
        let bowl = root(&|x, y| (0.1 * (x * x + y * y), 0.2 * DVec2::new(x, y)));
        assert!(!bowl.cap.is_flat() && f64::from(bowl.radius) < 1.001 * own(&bowl), "{} {}", bowl.radius, own(&bowl));
        // A node halfway between two sheets; its radius doubles at most.
        let sheets = |off: f64| {
            let height = move |x: f64, _| (if ((x + 1.0) * 25.0) as i32 % 2 == 0 { off } else { -off }, DVec2::ZERO);
            f64::from(root(&height).radius / plane.radius)
        };
        let off = 16.0 * 0.05 / f64::from(plane.radius);
        assert!((sheets(0.05) / 1f64.hypot(off) - 1.0).abs() < 0.02, "{} {off}", sheets(0.05));
        assert!((sheets(0.4) / 2.0 - 1.0).abs() < 0.1, "{}", sheets(0.4));
    }

    /// Normals that are far from the node's, or none at all, give finite heights.
    #[test]
    fn what_is_no_surface_has_numbers() {
        let across = [DVec3::X, DVec3::Y, DVec3::Z];
        let at = |x: f64, y: f64, normal: DVec3| (DVec3::new(x, y, 0.0), normal, 1.0);
        for below in [
            vec![],
            vec![at(0.0, 0.0, DVec3::Z)],
            vec![at(1.0, 0.0, DVec3::X), at(-1.0, 0.0, DVec3::NEG_X)],
            vec![at(1.0, 0.0, DVec3::NEG_Z), at(1e150, 0.0, DVec3::new(1e-9, 0.0, 1.0))],
        ] {
            let heights = fitted(below.into_iter(), across);
            let Cap(made) = cap(heights, [1.0, 0.5]);
            assert!(heights.iter().all(|height| height.is_finite()) && made.iter().all(|height| height.is_finite()));
        }
        let straight = fitted(
            [at(1.0, 0.0, DVec3::new(-0.1, 0.0, 1.0)), at(-1.0, 0.0, DVec3::new(0.1, 0.0, 1.0))].into_iter(),
            across,
        );
        assert!((straight[0] - 0.1).abs() < 1e-3 && straight[1] == 0.0 && straight[2] == 0.0, "{straight:?}");
    }
}
