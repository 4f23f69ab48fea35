//! Ellipses around a point: the shapes of disks.

use glam::{DMat2, DMat3, DVec2, DVec3};

/// Up to this many ellipses, the shape of each is tried for the ellipse around all of them.
const MANY: usize = 32;

/// A point q lies inside an ellipse if `q^T S^-1 q` is at most this: 1, plus rounding.
const HELD: f64 = 1.0 + 1e-9;

/// An ellipse around the origin: `q^T S^-1 q <= 1`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ellipse(DMat2);

impl Ellipse {
    /// Returns a small ellipse that contains all of `ellipses`. It has the shape of a circle, of
    /// one of them, or of their sum, whichever gives the smallest area.
    pub fn around(ellipses: &[DMat2]) -> Option<Self> {
        let sum = ellipses.iter().fold(DMat2::ZERO, |sum, one| sum + *one);
        let own = if ellipses.len() <= MANY { ellipses } else { &[] };
        let shapes = own.iter().copied().chain([DMat2::IDENTITY, sum]);
        let scaled = shapes.filter_map(|shape| {
            let inverse = shape.inverse();
            // The scale factor for the shape: the largest eigenvalue of shape^-1 S.
            let factor = ellipses.iter().map(|one| largest_eigenvalue(inverse * *one)).fold(0.0, f64::max);
            let scaled = shape * factor;
            (scaled.is_finite() && scaled.determinant() > 0.0).then_some(scaled)
        });
        scaled.min_by(|a, b| a.determinant().total_cmp(&b.determinant())).map(Self)
    }

    /// Returns the smallest ellipse that contains all `points` and has half-axes of at least the
    /// length `least`. Where that length limits the shorter half-axis, only some directions are
    /// tried, and the result may be larger.
    ///
    /// If the smallest ellipse of some points contains the others, it is the smallest ellipse of
    /// all points. So points are added one by one, each time the point that lies farthest outside.
    pub fn around_points(points: &[DVec2], least: f64) -> Self {
        let mut some = Vec::new();
        loop {
            let found = Self::of_few(&some, least);
            let inverse = found.0.inverse();
            let outside = points.iter().map(|point| (point.dot(inverse * *point), point));
            match outside.max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((value, point)) if value > HELD && !some.contains(point) => some.push(*point),
                _ => return found,
            }
        }
    }

    /// The ellipse of [`Self::around_points`] for a few points, by trial.
    ///
    /// An ellipse around the origin that cannot shrink passes through two points that are its
    /// conjugate half-diameters, or through three points; if the points lie on a line, through the
    /// farthest.
    fn of_few(points: &[DVec2], least: f64) -> Self {
        let farthest = points.iter().fold(0.0, |m: f64, point| m.max(point.length()));
        let mut best = Self(DMat2::from_diagonal(DVec2::splat(farthest.max(least).powi(2))));
        if farthest <= least {
            return best;
        }
        let mut square = best.square();
        let mut take = |shape: Option<Self>| {
            let Some(shape) = shape.filter(|shape| shape.square() < square) else { return };
            let thick = shape.at_least(least, points);
            if thick.square() < square && thick.holds(points) {
                (best, square) = (thick, thick.square());
            }
        };
        for (k, a) in points.iter().enumerate() {
            if !is_too_wide(*a, points, least) {
                take(Some(Self(outer(*a))));
            }
            for (l, b) in points.iter().enumerate().skip(k + 1) {
                take(Some(Self(outer(*a) + outer(*b))));
                points[l + 1..].iter().for_each(|c| take(Self::through([*a, *b, *c])));
            }
        }
        best
    }

    /// The ellipse through three points, if there is one.
    fn through(points: [DVec2; 3]) -> Option<Self> {
        // For each point, x^2 A + 2 x y B + y^2 C = 1.
        let row = |point: DVec2| DVec3::new(point.x * point.x, 2.0 * point.x * point.y, point.y * point.y);
        let rows = DMat3::from_cols(row(points[0]), row(points[1]), row(points[2])).transpose();
        let DVec3 { x: a, y: b, z: c } = rows.inverse() * DVec3::ONE;
        let shape = DMat2::from_cols(DVec2::new(a, b), DVec2::new(b, c));
        (a > 0.0 && shape.determinant() > 0.0).then(|| Self(shape.inverse())).filter(|found| found.0.is_finite())
    }

    /// The ellipse with half-axes of at least the length `least`. If the shorter half-axis is
    /// lengthened, the longer one keeps its direction and becomes as short as `points` permit.
    fn at_least(self, least: f64, points: &[DVec2]) -> Self {
        if self.is_surely_thick(least) {
            return self;
        }
        let [major, minor] = self.half_axes();
        if minor.length() >= least {
            return self;
        }
        let along = major.normalize_or(DVec2::X);
        // Solves x^2 / s^2 + y^2 / least^2 = 1 for s. It is NaN for a point with |y| > least, which
        // the maximum ignores and `holds` detects.
        let reach = |point: &DVec2| point.dot(along).abs() / (1.0 - (point.dot(along.perp()) / least).powi(2)).sqrt();
        let length = points.iter().map(reach).fold(least, f64::max);
        Self(outer(along * length) + outer(along.perp() * least))
    }

    /// Whether the shorter half-axis is longer than `least` by more than any rounding error. This
    /// takes no angle, unlike the half-axes.
    fn is_surely_thick(&self, least: f64) -> bool {
        /// A bound of the relative rounding errors, here and in the half-axes.
        const ROUNDING: f64 = 1e-9;
        let [a, b, c] = [self.0.x_axis.x, self.0.x_axis.y, self.0.y_axis.y];
        let (mean, apart) = (0.5 * (a + c), 0.5 * (a - c));
        let squared = mean - (apart * apart + b * b).sqrt();
        squared > least * least * (1.0 + ROUNDING) + mean * ROUNDING
    }

    /// Whether all points lie inside, up to rounding.
    fn holds(&self, points: &[DVec2]) -> bool {
        let inverse = self.0.inverse();
        points.iter().all(|point| point.dot(inverse * *point) <= HELD)
    }

    /// The product of the half-axes.
    pub fn square(&self) -> f64 {
        self.0.determinant().max(0.0).sqrt()
    }

    /// The half-axes, the longer one first; the second is the first direction turned left by 90
    /// degrees.
    pub fn half_axes(&self) -> [DVec2; 2] {
        let [a, b, c] = [self.0.x_axis.x, self.0.x_axis.y, self.0.y_axis.y];
        let angle = 0.5 * (2.0 * b).atan2(a - c);
        let along = DVec2::from_angle(angle);
        let length = |d: DVec2| d.dot(self.0 * d).max(0.0).sqrt();
        [along * length(along), along.perp() * length(along.perp())]
    }
}

/// Whether a point lies so far from the line through the origin and `a` that no ellipse along that
/// line with a shorter half-axis of `least` contains it: by 1 %, far more than [`HELD`] allows.
fn is_too_wide(a: DVec2, points: &[DVec2], least: f64) -> bool {
    let limit = 1.02 * least * least * a.length_squared();
    points.iter().any(|point| a.perp_dot(*point).powi(2) > limit)
}

/// The largest eigenvalue of a matrix whose eigenvalues are real.
fn largest_eigenvalue(m: DMat2) -> f64 {
    let half = 0.5 * (m.x_axis.x + m.y_axis.y);
    half + (half * half - m.determinant()).max(0.0).sqrt()
}

/// The outer product `d d^T`.
pub(crate) fn outer(d: DVec2) -> DMat2 {
    DMat2::from_cols(d * d.x, d * d.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_ellipse_holds_its_points_and_no_other_does_in_less() {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        for round in 0..200 {
            let points: Vec<DVec2> = (0..1 + round % 9).map(|_| DVec2::new(next(), 0.3 * next())).collect();
            let found = Ellipse::around_points(&points, 0.1);
            assert!(found.holds(&points), "{points:?}");
            assert!(found.half_axes()[1].length() >= 0.1 - 1e-9);
            // By trial: directions of the longer half-axis, and ratios of the two, with the least
            // length that contains the points.
            let mut tried = f64::INFINITY;
            for step in 0..4000 {
                let (along, slim) =
                    (DVec2::from_angle(f64::from(step % 200) * 0.0157), 0.05 * f64::from(1 + step / 200));
                let reach = |p: &DVec2| p.dot(along).hypot(p.dot(along.perp()) / slim);
                let major = points.iter().map(reach).fold(0.0, f64::max);
                tried = tried.min(major.max(0.1) * (major * slim).max(0.1));
            }
            // Where `least` limits the shorter half-axis, only some directions of the longer one
            // are tried.
            let lost = if found.half_axes()[1].length() > 0.1 + 1e-9 { 1.0 + 1e-9 } else { 1.2 };
            assert!(found.square() <= tried * lost, "{} {tried} {points:?}", found.square());
        }
    }

    #[test]
    fn points_on_a_line_or_of_a_square_have_theirs() {
        let lengths = |points: &[DVec2]| Ellipse::around_points(points, 0.25).half_axes().map(|axis| axis.length());
        let near = |[a, b]: [f64; 2], [c, d]: [f64; 2]| (a - c).abs() < 1e-12 && (b - d).abs() < 1e-12;
        assert!(near(lengths(&[]), [0.25, 0.25]));
        assert!(near(lengths(&[DVec2::X, 3.0 * DVec2::X, -2.0 * DVec2::X]), [3.0, 0.25]));
        let corners = [DVec2::ONE, DVec2::new(-1.0, 1.0), DVec2::new(1.0, -1.0), -DVec2::ONE];
        assert!(near(lengths(&corners), [2f64.sqrt(); 2]));
        assert!(near(lengths(&corners.map(|corner| corner * DVec2::new(3.0, 1.0))), [18f64.sqrt(), 2f64.sqrt()]));
    }
}
