//! How the surface that a node stands for curves: the linear field of normals that is nearest to those of what is right below it, and with it a
//! paraboloid whose normals these are.
//!
//! Pajarola 2003 (section 5.2) tilts the normals at a coarse splat's corners outward by the angle of its cone, as if all surfaces were convex and curved
//! as much in any direction. Here a symmetric matrix is fitted, which tells hollows, saddles and cylinders.

use glam::{DMat2, DMat3, DVec2, DVec3};

use super::below::Below;
use super::sums::normal_of;
use crate::scene::Cap;
use crate::scene::hierarchy::FAN_OUT;
use crate::surfels::eigen::Symmetric3;

/// A normal that leans farther from the node's counts as one that leans so far: the cosine of 76 degrees.
const LEAST_COSINE: f64 = 0.25;

/// What is added to the squares that the fit divides by, of their sum: where points lie on a line nothing is told across it.
const RIDGE: f64 = 1e-3;

/// Nodes whose normals point less in one direction are flat: they are no part of one surface, and of what a fit of their normals says a speck of light is left. Of 0.7 to 0.95
/// that with which the Dragon's nodes at 4 to 64 px are nearest to all surfels.
pub(super) const LEAST_ALIGNMENT: f64 = 0.9;

/// Those of a plane.
pub(super) const FLAT: Heights = [0.0; 3];

/// Heights over a plane, `(xx x² + 2 xy x y + yy y²) / 2` along its normal for x and y along two of its directions: xx, xy, yy, 1 / world unit.
pub(super) type Heights = [f64; 3];

/// Those of the node `of` with the centre `center`, over the plane of these unit directions and of this normal.
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

/// Those of a node whose plane has these unit directions and this normal, of the normals and places of what is right below it.
fn fitted(below: impl Iterator<Item = (DVec3, DVec3, f64)>, [along, across, normal]: [DVec3; 3]) -> Heights {
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    let mut right = DVec3::ZERO;
    for (offset, own, weight) in below {
        let (x, y) = (offset.dot(along), offset.dot(across));
        let up = own.dot(normal);
        // Normals without a side are on either.
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

/// The mean of these heights over points with this covariance about the centre, world units, and no more than half of how far these are spread: normals of
/// what is far from flat tell no heights.
pub(super) fn mean_height(heights: Heights, covariance: Symmetric3, plane: [DVec3; 3]) -> f64 {
    let spread = in_plane(covariance, plane);
    let most = 0.5 * trace(spread).max(0.0).sqrt();
    (0.5 * trace(matrix(heights) * spread)).clamp(-most, most)
}

/// How far points lie from a cap with these heights along its normal at least, world units, root mean square: by the covariance of `all` of them less what the
/// cap's heights would vary over places with that of the `centers`, were these spread as a normal distribution is (1/2 tr (H C)²: more than over a disk or
/// a square, so that of what a cap shows nothing is left). A cap that leaves points which lie in a plane is not told.
pub(super) fn off_cap(heights: Heights, [all, centers]: [Symmetric3; 2], plane: [DVec3; 3]) -> f64 {
    let [.., normal] = plane;
    let shown = matrix(heights) * in_plane(centers, plane);
    (normal.dot(all.times(normal)) - 0.5 * trace(shown * shown)).max(0.0).sqrt()
}

/// As a matrix of the plane's two directions.
pub(super) fn matrix([xx, xy, yy]: Heights) -> DMat2 {
    DMat2::from_cols_array(&[xx, xy, xy, yy])
}

/// The part of a covariance along the plane's directions.
fn in_plane(covariance: Symmetric3, [along, across, _]: [DVec3; 3]) -> DMat2 {
    let of = |a: DVec3, b: DVec3| a.dot(covariance.times(b));
    matrix([of(along, along), of(along, across), of(across, across)])
}

fn trace(m: DMat2) -> f64 {
    m.x_axis.x + m.y_axis.y
}

/// The cap of a disk with half-axes of these lengths along the plane's directions.
pub(super) fn cap([xx, xy, yy]: Heights, [s, t]: [f64; 2]) -> Cap {
    Cap([xx * s * s, xy * s * t, yy * t * t].map(|height| height as f32)).usable(s.max(t))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use glam::Vec3;

    use super::super::build;
    use super::*;
    use crate::scene::hierarchy::Node;
    use crate::scene::{Scene, Surfel};

    /// Surfels of a height field, by its heights and slopes.
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

    /// A paraboloid's nodes have its curvature, wherever it bends and however normals point; a plane's have none.
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
                // Of points on a line nothing is told across it.
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
                    // And they lie on it.
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

    /// What lies off its cap makes a node count as larger than its ball; what curves as its cap does, or not at all, does not.
    #[test]
    fn what_lies_off_a_cap_counts() {
        let root = |height: &dyn Fn(f64, f64) -> (f64, DVec2)| build(field(height, true), &()).unwrap().1.nodes[0];
        // What the node itself reaches to, which is as far as what is below it where its ellipse ends there.
        let own = |node: &Node| f64::from(node.surfel.radius()) + node.cap.highest();
        let plane = root(&|_, _| (0.0, DVec2::ZERO));
        assert!(f64::from(plane.radius) < 1.001 * own(&plane), "{} {}", plane.radius, own(&plane));
        // Off a plane through its middle this bowl's points lie by 0.042, which would count as 1.08 times its ball.
        let bowl = root(&|x, y| (0.1 * (x * x + y * y), 0.2 * DVec2::new(x, y)));
        assert!(!bowl.cap.is_flat() && f64::from(bowl.radius) < 1.001 * own(&bowl), "{} {}", bowl.radius, own(&bowl));
        // Two sheets, of which the node between them is as far from either, and twice as large at most.
        let sheets = |off: f64| {
            let height = move |x: f64, _| (if ((x + 1.0) * 25.0) as i32 % 2 == 0 { off } else { -off }, DVec2::ZERO);
            f64::from(root(&height).radius / plane.radius)
        };
        let off = 16.0 * 0.05 / f64::from(plane.radius);
        assert!((sheets(0.05) / 1f64.hypot(off) - 1.0).abs() < 0.02, "{} {off}", sheets(0.05));
        assert!((sheets(0.4) / 2.0 - 1.0).abs() < 0.1, "{}", sheets(0.4));
    }

    /// Normals that are far from the node's, or none, leave numbers.
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
