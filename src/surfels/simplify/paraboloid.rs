//! The curvature of a growing cap: the paraboloid through the points that it holds.

use glam::{DMat2, DMat4, DVec2, DVec3, DVec4};

use crate::scene::Cap;

/// Points on a strip do not determine the curvature across it. The determinant of the normal
/// equations must be at least this fraction of the fourth power of their trace. For points on a
/// disk the fraction is 5e-5; for a strip it falls with the sixth power of the strip's width.
const LEAST_SPREAD: f64 = 1e-8;

/// Heights over the tangent plane of a splat's point, `x u² + y u v + z v²` at (u, v) in the basis
/// of that plane, scaled units. They are zero for a disk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Paraboloid(DVec3);

impl Paraboloid {
    pub const FLAT: Self = Self(DVec3::ZERO);

    /// Fits a paraboloid to points (u, v, height) by least squares, up to a constant that is added
    /// to all heights. None if the points do not determine it.
    pub fn through(points: impl Iterator<Item = DVec3> + Clone) -> Option<Self> {
        let reach = points.clone().map(|point| point.length()).fold(0.0, f64::max);
        let (mut matrix, mut right) = (DMat4::ZERO, DVec4::ZERO);
        for point in points {
            let point = point / reach;
            let row = DVec4::new(point.x * point.x, point.x * point.y, point.y * point.y, 1.0);
            matrix += DMat4::from_cols(row * row.x, row * row.y, row * row.z, row);
            right += row * point.z;
        }
        let trace: f64 = (0..4).map(|k| matrix.col(k)[k]).sum();
        let found = (matrix.inverse() * right).truncate() / reach;
        (found.is_finite() && matrix.determinant() > LEAST_SPREAD * trace.powi(4)).then_some(Self(found))
    }

    /// The slope of the least-squares plane through the heights of points over the paraboloid. None
    /// if the points do not determine it.
    pub fn tilt(&self, points: impl Iterator<Item = DVec3>) -> Option<DVec2> {
        let outer = |a: DVec2| DMat2::from_cols(a * a.x, a * a.y);
        let (mut matrix, mut right, mut sum, mut count) = (DMat2::ZERO, DVec2::ZERO, DVec3::ZERO, 0.0);
        for point in points {
            let (at, over) = (point.truncate(), self.over(point.truncate(), point.z));
            matrix += outer(at);
            right += at * over;
            sum += at.extend(over);
            count += 1.0;
        }
        let mean = sum.truncate() / count;
        Some((matrix - outer(mean) * count).inverse() * (right - mean * sum.z)).filter(|tilt| tilt.is_finite())
    }

    pub fn is_flat(&self) -> bool {
        self.0 == DVec3::ZERO
    }

    fn height(&self, at: DVec2) -> f64 {
        self.0.dot(DVec3::new(at.x * at.x, at.x * at.y, at.y * at.y))
    }

    /// The height over the paraboloid of a point at (u, v) with this height over the plane. It is
    /// at least the distance from the paraboloid.
    pub fn over(&self, at: DVec2, height: f64) -> f64 {
        height - self.height(at)
    }

    /// The cap over half-axes s and t, which are given in the basis of the plane; its heights are
    /// in the same unit.
    pub fn cap(&self, [s, t]: [DVec2; 2]) -> Cap {
        let product = |a: DVec2, b: DVec2| {
            2.0 * self.0.x * a.x * b.x + self.0.y * (a.x * b.y + a.y * b.x) + 2.0 * self.0.z * a.y * b.y
        };
        Cap([product(s, s), product(s, t), product(t, t)].map(|height| height as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_a_paraboloid_lie_on_the_one_through_them() {
        let height = |u: f64, v: f64| 0.25 - 0.3 * u * u + 0.2 * u * v + 0.1 * v * v;
        let place = |k: i32| ((f64::from(k) * 1.7).sin(), (f64::from(k) * 2.3).cos());
        let points = (0..20).map(place).map(|(u, v)| DVec3::new(u, v, height(u, v)));
        let Some(found) = Paraboloid::through(points.clone()) else { unreachable!() };
        for point in points {
            let over = found.over(point.truncate(), point.z - 0.25);
            assert!(over.abs() < 1e-12, "{over}");
            assert!(Paraboloid::FLAT.over(point.truncate(), 0.5) == 0.5);
        }
        let axes = [DVec2::new(0.6, 0.8), DVec2::new(-0.4, 0.3)];
        let at = axes[0] * 0.5 + axes[1] * 0.7;
        assert!((found.cap(axes).height(0.5, 0.7) - (height(at.x, at.y) - 0.25)).abs() < 1e-7);
        assert_eq!(Paraboloid::through([DVec3::ZERO; 3].into_iter()), None);
    }
}
