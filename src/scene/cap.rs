//! How a disk curves out of its plane.

use glam::DVec2;

/// Heights of a curved surfel over the plane of its disk: a paraboloid that touches the plane at the disk's centre. At (u, v) of the
/// unit disk it lies `(uu u² + 2 uv u v + vv v²) / 2` along the unit normal s x t, for `[uu, uv, vv]` in world units. A surface of the
/// curvature k along s, bent away from its normal, has `uu = -k |s|²`. (Paper 001, section 3: "slightly curved surface".)
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cap(pub [f32; 3]);

impl Cap {
    /// A flat disk.
    pub const FLAT: Self = Self([0.0; 3]);

    /// The most that a cap may rise or sink, in the longer half-axis of its disk: past half a sphere no disk stands for a surface.
    pub const HIGHEST: f64 = 1.0;

    /// Whether it is flat.
    pub fn is_flat(&self) -> bool {
        self.0 == [0.0; 3]
    }

    /// The same, no higher than [`Cap::HIGHEST`] times `radius`; flat if it is not finite.
    pub fn usable(self, radius: f64) -> Self {
        if !self.0.iter().all(|height| height.is_finite()) {
            return Self::FLAT;
        }
        let most = Self::HIGHEST * radius;
        // No height is more than half of the sum of these, which most are far below.
        if 0.5 * self.0.iter().map(|height| f64::from(height.abs())).sum::<f64>() <= most {
            return self;
        }
        let highest = self.highest();
        // A little less than the most, so that a cap that was lowered to it stays as it is when it is read again.
        let factor = if highest > most * (1.0 + 1e-6) { most / highest } else { 1.0 };
        Self(self.0.map(|height| (f64::from(height) * factor) as f32))
    }

    /// The largest distance from the plane, world units.
    pub fn highest(&self) -> f64 {
        let [low, high] = self.extremes();
        high.max(-low)
    }

    /// The height at (u, v), world units.
    pub fn height(&self, u: f64, v: f64) -> f64 {
        0.5 * self.slope(u, v).dot(DVec2::new(u, v))
    }

    /// What the height gains for a unit of u, and of v, world units.
    pub fn slope(&self, u: f64, v: f64) -> DVec2 {
        let [uu, uv, vv] = self.0.map(f64::from);
        DVec2::new(uu * u + uv * v, uv * u + vv * v)
    }

    /// The least and the largest height over the unit disk, world units, of which the plane's 0 is one or lies between.
    pub fn extremes(&self) -> [f64; 2] {
        let [uu, uv, vv] = self.0.map(f64::from);
        // Half the eigenvalues of the heights' matrix.
        let (mean, spread) = (0.25 * (uu + vv), (0.25 * (uu - vv)).hypot(0.5 * uv));
        [(mean - spread).min(0.0), (mean + spread).max(0.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_lie_between_the_extremes_and_reach_them() {
        for cap in [Cap([1.0, 0.5, -2.0]), Cap([-1.0, 0.25, -0.5]), Cap([3.0, 0.0, 0.0]), Cap::FLAT] {
            let [low, high] = cap.extremes();
            let (mut least, mut most) = (0.0f64, 0.0f64);
            for k in 0..10_000 {
                let (sin, cos) = (f64::from(k) * 1e-4 * std::f64::consts::TAU).sin_cos();
                (least, most) = (least.min(cap.height(cos, sin)), most.max(cap.height(cos, sin)));
                assert!(cap.height(0.3 * cos, 0.3 * sin) <= high && cap.height(0.3 * cos, 0.3 * sin) >= low);
            }
            assert!((least - low).abs() < 1e-6 && (most - high).abs() < 1e-6, "{cap:?} {least} {most}");
        }
    }

    #[test]
    fn a_cap_that_is_too_high_is_lowered_once() {
        let high = Cap([0.0, 8.0, 0.0]).usable(2.0);
        assert_eq!(high, Cap([0.0, 4.0, 0.0]));
        assert_eq!(high.usable(2.0), high);
        assert_eq!(Cap([1.0, 0.0, f32::NAN]).usable(2.0), Cap::FLAT);
        let low = Cap([0.5, 0.1, -0.2]);
        assert_eq!(low.usable(2.0), low);
    }
}
