//! Curved disks: the height of a surfel over its plane.

use glam::DVec2;

/// A paraboloid over the plane of a disk, which it touches at the centre.
///
/// At (u, v) of the unit disk its height along the unit normal s x t is
/// `(uu u² + 2 uv u v + vv v²) / 2`, with `[uu, uv, vv]` in world units. A surface of curvature k
/// along s, bent away from its normal, has `uu = -k |s|²`. (Paper 001, section 3: "slightly curved
/// surface".)
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cap(pub [f32; 3]);

impl Cap {
    /// A flat disk.
    pub const FLAT: Self = Self([0.0; 3]);

    /// The largest height or depth of a cap, as a fraction of the disk's longer half-axis: beyond a
    /// hemisphere a disk no longer represents a surface.
    pub const HIGHEST: f64 = 1.0;

    /// Whether the disk is flat.
    pub fn is_flat(&self) -> bool {
        self.0 == [0.0; 3]
    }

    /// The cap lowered to at most [`Cap::HIGHEST`] times `radius`; flat if it is not finite.
    pub fn usable(self, radius: f64) -> Self {
        if !self.0.iter().all(|height| height.is_finite()) {
            return Self::FLAT;
        }
        let most = Self::HIGHEST * radius;
        // Half this sum bounds every height, and for most caps it is far below the limit.
        if 0.5 * self.0.iter().map(|height| f64::from(height.abs())).sum::<f64>() <= most {
            return self;
        }
        let highest = self.highest();
        // The tolerance leaves a cap that was lowered to the limit unchanged when it is read again.
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

    /// The gradient of the height with respect to u and v, world units.
    pub fn slope(&self, u: f64, v: f64) -> DVec2 {
        let [uu, uv, vv] = self.0.map(f64::from);
        DVec2::new(uu * u + uv * v, uv * u + vv * v)
    }

    /// The smallest and largest height over the unit disk, world units; their interval includes 0.
    pub fn extremes(&self) -> [f64; 2] {
        let [uu, uv, vv] = self.0.map(f64::from);
        // Half the eigenvalues of the matrix [uu, uv; uv, vv].
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
