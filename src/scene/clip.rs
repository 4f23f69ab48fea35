//! Clip lines, at which a disk ends before its rim.

use glam::{DVec2, DVec3};

/// Two clip lines (x, y, z) of a disk: the points (u, v) of the unit disk with `x u + y v + z >= 0`
/// for both lines are kept.
///
/// The disk's centre may be clipped away. (Zwicker, Raesaenen, Botsch, Dachsbacher and Pauly 2004,
/// *Perspective Accurate Splatting*, section 5.)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clip(pub [[f32; 3]; 2]);

impl Clip {
    /// Lines that clip nothing.
    pub const NONE: Self = Self([[0.0, 0.0, 1.0]; 2]);

    /// The clip line that keeps `normal . q >= offset`, for a disk with the half-axes s and t.
    ///
    /// q is the vector from the disk's centre within its plane, in the units of the half-axes. The
    /// line is scaled so that its largest coefficient has magnitude 1, as half-axes may have any
    /// length.
    pub fn line(normal: DVec2, offset: f64, [s, t]: [DVec2; 2]) -> [f32; 3] {
        let line = [normal.dot(s), normal.dot(t), -offset];
        let longest = line.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        line.map(|x| (x / longest) as f32)
    }

    /// Whether the lines clip nothing.
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// The lines scaled so that their largest coefficients have magnitude 1, so that no product
    /// overflows. A line that is zero or not finite is replaced by one that clips nothing.
    pub fn usable(self) -> Self {
        Self(self.0.map(|line| {
            let longest = line.iter().fold(0.0f32, |longest, x| longest.max(x.abs()));
            let usable = line.iter().all(|x| x.is_finite()) && longest > 0.0;
            if usable { line.map(|x| x / longest) } else { Self::NONE.0[0] }
        }))
    }

    /// The smaller of the two line functions at (u, v), in the lines' own scales; negative where
    /// the point is clipped away.
    pub fn inside(&self, u: f64, v: f64) -> f64 {
        let along = |line: [f32; 3]| DVec3::from(line.map(f64::from)).dot(DVec3::new(u, v, 1.0));
        along(self.0[0]).min(along(self.0[1]))
    }

    /// Returns the point (u, v) of the clipped unit disk that lies farthest in the direction `(a,
    /// b)`; the centre if nothing of the disk is kept.
    ///
    /// It is the disk's own farthest point, an end of a line's chord, or the corner of both lines.
    pub fn farthest(&self, a: f64, b: f64) -> [f64; 2] {
        let along = DVec2::new(a, b);
        let rim = along.normalize_or_zero();
        let lines = self.0.map(|line| DVec3::from(line.map(f64::from)));
        let chord = |line: DVec3| {
            let (normal, length) = (line.truncate(), line.truncate().length());
            let foot = -line.z / length;
            let half = (1.0 - foot * foot).sqrt();
            [1.0, -1.0].map(|sign| (normal * foot + normal.perp() * (sign * half)) / length)
        };
        let [one, other] = lines;
        let corner = one.cross(other);
        let corner = DVec2::new(corner.x, corner.y) / corner.z;
        // A point of one line is a rounding off it; NaN, where lines do not meet, is not kept.
        let is_kept = |p: &DVec2| p.length() <= 1.0 + 1e-9 && self.inside(p.x, p.y) >= -1e-9;
        let all = [rim, corner].into_iter().chain(lines.into_iter().flat_map(chord)).filter(is_kept);
        all.max_by(|p, q| p.dot(along).total_cmp(&q.dot(along))).unwrap_or_default().to_array()
    }

    /// The fraction of the segment from the disk's centre to (u, v) that is kept; 0 if the centre
    /// is clipped away.
    pub fn reach(&self, u: f64, v: f64) -> f64 {
        let of_line = |line: [f32; 3]| {
            let [x, y, z] = line.map(f64::from);
            let falls = -(x * u + y * v);
            match z {
                z if z < 0.0 => 0.0,
                z if falls > z => z / falls,
                _ => 1.0,
            }
        };
        of_line(self.0[0]).min(of_line(self.0[1]))
    }
}

impl Default for Clip {
    fn default() -> Self {
        Self::NONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_on_the_far_side_of_either_line_is_left_out() {
        let corner = Clip([[1.0, 0.0, 0.25], [0.0, -1.0, 0.0]]);
        assert!(corner.inside(0.0, -0.5) > 0.0 && corner.inside(-0.2, 0.0) >= 0.0);
        assert!(corner.inside(-0.3, -0.5) < 0.0 && corner.inside(0.5, 0.1) < 0.0);
        assert_eq!(Clip::NONE.inside(1.0, -1.0), 1.0);
        assert_eq!((corner.reach(-1.0, 0.0), corner.reach(1.0, -1.0), corner.reach(0.0, 1.0)), (0.25, 1.0, 0.0));
        let (u, v) = (0.6f64.sqrt(), 0.4f64.sqrt());
        for ([a, b], expected) in [
            ([-1.0, 0.0], [-0.25, 0.0]),
            ([0.0, 1.0], [0.0, 0.0]),
            ([0.0, -1.0], [0.0, -1.0]),
            ([u, -v], [u, -v]),
            ([-1.0, -1e-3], [-0.25, -(1.0 - 0.0625f64).sqrt()]),
        ] {
            let [x, y] = corner.farthest(a, b);
            assert!((x * a + y * b) - (expected[0] * a + expected[1] * b) < 1e-12, "{a} {b}: {x} {y}");
            assert!((x * a + y * b) - (expected[0] * a + expected[1] * b) > -1e-12, "{a} {b}: {x} {y}");
        }
        assert_eq!(Clip([[1.0, 0.0, -2.0], [0.0, 0.0, 1.0]]).farthest(1.0, 0.0), [0.0, 0.0]);
        let line = Clip::line(DVec2::Y, -0.5, [DVec2::X * 3.0, DVec2::Y * 2.0]);
        assert_eq!(line, [0.0, 1.0, 0.25]);
        let odd = Clip([[f32::NAN, 0.0, 0.0], [0.0, 3e38, -3e38]]);
        assert_eq!(odd.usable(), Clip([[0.0, 0.0, 1.0], [0.0, 1.0, -1.0]]));
    }
}
