//! The ellipse that bounds a neighbourhood in its tangent plane.

use glam::DVec3;

/// The number of neighbours that an ellipse bounds: the first two rings of a square grid.
pub(crate) const ELLIPSE_NEIGHBOURS: usize = 8;

/// The shorter half-axis is at least this fraction of the longer one. The neighbours of a point in
/// a scan line may all lie on that line, which does not tell how far away the next line is.
const SLIMMEST: f64 = 0.2;

/// Returns the half-axes s (the longer one) and t of an ellipse around the origin. It bounds the
/// projections of `offsets` onto the plane perpendicular to the unit vector `normal`, and s x t is
/// along `normal`.
///
/// The half-axes are in the unit of the offsets, and zero if all projections are.
///
/// The source is Pajarola et al. 2003, section 3.4, but around the point itself instead of the mean
/// (their Eq. 2 allows any centre). The covariance in the plane has the eigenvalues of Eq. 5, whose
/// trace term is -trace(M) lambda, misprinted there. Eigenvalues are variances, so the half-axes
/// are proportional to their square roots. One factor f then scales both until no projection is
/// outside: f^2 is the largest x^2/a^2 + y^2/b^2.
pub(crate) fn bounding_ellipse(offsets: impl Iterator<Item = DVec3> + Clone, normal: DVec3) -> [DVec3; 2] {
    let largest = offsets.clone().fold(0.0, |m: f64, o| m.max(o.abs().max_element()));
    if largest == 0.0 {
        return [DVec3::ZERO; 2];
    }
    let (e1, e2) = normal.any_orthonormal_pair();
    // Offsets are scaled to at most 1, so that fourth powers of lengths neither overflow nor
    // underflow.
    let plane = offsets.map(|offset| {
        let offset = offset / largest;
        (offset.dot(e1), offset.dot(e2))
    });
    let (xx, xy, yy) = plane.clone().fold((0.0, 0.0, 0.0), |(xx, xy, yy), (x, y)| (xx + x * x, xy + x * y, yy + y * y));
    let Some(([x, y], slimness)) = shape([xx, xy, yy]) else { return [DVec3::ZERO; 2] };
    let squared_factor = plane.fold(0.0, |f: f64, (u, v)| {
        let (along, across) = (u * x + v * y, (v * x - u * y) / slimness);
        f.max(along * along + across * across)
    });
    let s = (e1 * x + e2 * y) * (squared_factor.sqrt() * largest);
    [s, normal.cross(s) * slimness]
}

/// Returns the unit direction of the longer half-axis and the ratio of the shorter to the longer
/// half-axis, for the ellipse of a covariance matrix [xx, xy, yy]. The ratio is at least
/// [`SLIMMEST`]. None if the matrix is zero.
pub(crate) fn shape([xx, xy, yy]: [f64; 3]) -> Option<([f64; 2], f64)> {
    let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let root = (half * half + xy * xy).sqrt();
    let (large, small) = (mean + root, (mean - root).max(0.0));
    if large == 0.0 {
        return None;
    }
    // Both columns of M - small I are along the eigenvector; this is the one without cancellation.
    let (x, y) = if half >= 0.0 { (half + root, xy) } else { (xy, root - half) };
    let length = (x * x + y * y).sqrt();
    let direction = if length > 0.0 { [x / length, y / length] } else { [1.0, 0.0] };
    Some((direction, (small / large).sqrt().max(SLIMMEST)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn reach([s, t]: [DVec3; 2], offset: DVec3) -> f64 {
        (offset.dot(s) / s.length_squared()).hypot(offset.dot(t) / t.length_squared())
    }

    #[test]
    fn a_stretched_grid_has_the_ellipse_of_its_stretch() {
        let normal = DVec3::new(2.0, -1.0, 2.0) / 3.0;
        let (a, b) = (DVec3::new(1.0, 2.0, 0.0).normalize(), normal.cross(DVec3::new(1.0, 2.0, 0.0).normalize()));
        for (size, stretch) in [(1.0, 1.0), (1e-100, 2.0), (1e100, 4.0)] {
            let ring: Vec<DVec3> = (0..9)
                .filter(|i| *i != 4)
                .map(|i| (a * (f64::from(i % 3) - 1.0) * stretch + b * (f64::from(i / 3) - 1.0)) * size)
                .collect();
            let [s, t] = bounding_ellipse(ring.iter().copied(), normal);
            // The corners of the ring are on the rim: (stretch / a)^2 + (1 / b)^2 = 1, with
            // a = stretch b.
            let (half_axis, slim) = (2f64.sqrt() * size, stretch);
            assert!((s.length() / (half_axis * slim) - 1.0).abs() < 1e-12, "{stretch}");
            assert!((t.length() / half_axis - 1.0).abs() < 1e-12, "{stretch}");
            assert!((s / size).cross(t / size).normalize().distance(normal) < 1e-12);
            if stretch > 1.0 {
                assert!(s.normalize().cross(a).length() < 1e-12);
            }
            // Eigenvalues instead of their square roots would give an axis ratio of stretch
            // squared.
            assert!((s.length() / t.length() - stretch).abs() < 1e-12 * stretch);
        }
    }

    #[test]
    fn every_neighbour_is_inside_and_one_on_the_rim() {
        let mut state = 3u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        for round in 0..1000 {
            let normal = DVec3::new(next(), next(), next()).normalize();
            let stretch = DVec3::new(1.0, 1.0 / f64::from(1 + round % 7), 0.3);
            let offsets: Vec<DVec3> = (0..8).map(|_| DVec3::new(next(), next(), next()) * stretch).collect();
            let axes = bounding_ellipse(offsets.iter().copied(), normal);
            let farthest = offsets.iter().map(|o| reach(axes, *o)).fold(0.0, f64::max);
            assert!((farthest - 1.0).abs() < 1e-12, "{farthest}");
            let [s, t] = axes;
            assert!(s.dot(t).abs() < 1e-12 && s.dot(normal).abs() < 1e-12 && s.cross(t).dot(normal) > 0.0);
            assert!(t.length() >= SLIMMEST * s.length() * (1.0 - 1e-12) && t.length() <= s.length() * (1.0 + 1e-12));
        }
    }

    #[test]
    fn neighbours_in_a_line_or_at_one_place_have_an_ellipse() {
        let line = (1..9).map(|i| DVec3::X * f64::from(i));
        let [s, t] = bounding_ellipse(line, DVec3::Z);
        assert!((s - DVec3::X * 8.0).length() < 1e-12 && (t - DVec3::Y * 8.0 * SLIMMEST).length() < 1e-12);
        assert_eq!(bounding_ellipse(std::iter::empty(), DVec3::Z), [DVec3::ZERO; 2]);
        let along_normal = std::iter::repeat_n(DVec3::Z, 8);
        assert_eq!(bounding_ellipse(along_normal, DVec3::Z), [DVec3::ZERO; 2]);
    }
}
