//! The intersection test of a triangle and a box, by the separating axis theorem.

use glam::DVec3;

use crate::scene::Bounds;

/// Returns whether the triangle meets the closed box.
///
/// The separating axis theorem: two convex bodies are disjoint if and only if one of these axes
/// separates them: a face normal of either body, or the cross product of an edge of one with an
/// edge of the other. Here these are three normals of the box, one of the triangle, and nine
/// products. A triangle within rounding error of the box counts as meeting it.
pub(super) fn overlaps(corners: &[DVec3; 3], bounds: &Bounds) -> bool {
    let (center, half) = (bounds.center(), 0.5 * bounds.extent());
    let corners = corners.map(|corner| corner - center);
    let size = corners.iter().fold(half.max_element(), |size, corner| size.max(corner.abs().max_element()));
    let apart = |axis: DVec3| {
        let along = corners.map(|corner| corner.dot(axis));
        let [low, high] =
            [along.into_iter().fold(f64::INFINITY, f64::min), along.into_iter().fold(f64::NEG_INFINITY, f64::max)];
        let reach = half.dot(axis.abs()) + 8.0 * f64::EPSILON * size * axis.abs().element_sum();
        low > reach || high < -reach
    };
    let [a, b, c] = corners;
    let edges = [b - a, c - b, a - c];
    !(DVec3::AXES.into_iter().any(apart)
        || apart(edges[0].cross(edges[1]))
        || edges.iter().any(|edge| DVec3::AXES.into_iter().any(|axis| apart(axis.cross(*edge)))))
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: Bounds = Bounds { min: DVec3::ZERO, max: DVec3::ONE };

    fn noise() -> impl FnMut() -> f64 {
        let mut state = 5u64;
        move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    #[test]
    fn known_cases() {
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        // The triangle's bounding box contains a corner of the box, which lies beyond the
        // triangle's plane; then beyond an edge.
        assert!(!overlaps(&[3.1 * x, 3.1 * y, 3.1 * z], &UNIT) && overlaps(&[2.9 * x, 2.9 * y, 2.9 * z], &UNIT));
        let beside = |d: f64| [DVec3::new(2.0 + d, 0.0, 0.5), DVec3::new(d, 2.0, 0.5), DVec3::new(2.0 + d, 2.0, 0.5)];
        assert!(overlaps(&beside(-0.01), &UNIT) && !overlaps(&beside(0.01), &UNIT));
        // Contact in a corner, an edge and a face; a triangle around the whole box; points.
        assert!(overlaps(&[DVec3::ONE, 2.0 * DVec3::ONE, DVec3::new(3.0, 2.0, 2.0)], &UNIT));
        assert!(overlaps(&[DVec3::new(-9.0, -9.0, 1.0), DVec3::new(9.0, -9.0, 1.0), DVec3::new(0.0, 9.0, 1.0)], &UNIT));
        assert!(!overlaps(
            &[DVec3::new(-9.0, -9.0, 1.001), DVec3::new(9.0, -9.0, 1.001), DVec3::new(0.0, 9.0, 1.001)],
            &UNIT
        ));
        assert!(overlaps(&[0.5 * DVec3::ONE; 3], &UNIT) && !overlaps(&[1.5 * DVec3::ONE; 3], &UNIT));
    }

    #[test]
    fn it_agrees_with_points_of_the_triangle() {
        let mut next = noise();
        let (mut met, mut missed) = (0, 0);
        for _ in 0..4000 {
            let mut corner = || DVec3::new(3.0 * next() - 1.0, 3.0 * next() - 1.0, 3.0 * next() - 1.0);
            let corners = [corner(), corner(), corner()];
            // The largest depth in the box of many points of the triangle; negative outside.
            let mut depth = f64::NEG_INFINITY;
            for i in 0..=60 {
                for j in 0..=60 - i {
                    let (u, v) = (f64::from(i) / 60.0, f64::from(j) / 60.0);
                    let p = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
                    depth = depth.max(p.min(DVec3::ONE - p).min_element());
                }
            }
            let found = overlaps(&corners, &UNIT);
            if depth >= 0.0 {
                assert!(found, "{corners:?}");
                met += 1;
            } else if depth < -0.08 {
                // The distance exceeds the spacing of the points.
                assert!(!found, "{corners:?} {depth}");
                missed += 1;
            }
        }
        assert!(met > 300 && missed > 300, "{met} {missed}");
    }
}
