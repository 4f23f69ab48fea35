//! Stage 2 of [`Composite::Moments`](crate::scene::Composite::Moments): the moments of each pixel's
//! optical depth as a measure over depth.
//!
//! After Münstermann, Krumpen, Klein and Peters 2018, Moment-based order-independent transparency.
//!
//! A fragment of alpha a at depth y, mapped to [-1, 1] over the scene's depths, adds `h y^k` with
//! `h = -ln(1 - a)` to the moments k = 0 to 4. For a given depth x, one measure with these moments
//! has mass at x and at just two other depths (the canonical representation; the two depths are the
//! zeros of the second orthogonal polynomial through x). No measure with these moments has less
//! mass before x than the canonical one, and none has more up to and including x. The mass in front
//! of x is estimated as the canonical measure's mass before x plus a quarter of its mass at x
//! (paper, section 3.2). The transmittance is `exp` of minus that estimate.
//!
//! A fragment's weight is the transmittance in front of it divided by that in front of the nearest
//! fragment. The nearest weight is then 1 however dense the pixel is; as colours are means, a
//! factor that all weights of a pixel share cancels.
//!
//! Moments are 64-bit integer sums in units of 2^-26, so the result does not depend on the order of
//! fragments; the paper sums floats. Because f32 loses nearly all digits of nearly degenerate
//! moments, they are mixed with the moments of a spread-out measure, in a share of 2^-14. The paper
//! takes that share for 16-bit moments, and a hundredth of it for floats. Depths are not warped by
//! a logarithm, because they are relative to the scene's body and not to clip planes.

use super::Strip;
use super::oit::{held_back, visit};

/// The share of the spread-out measure that is mixed in.
const MIXED: f64 = 1.0 / 16384.0;

/// Moments 1 to 4 of the spread-out measure, whose mass is 1.
const SPREAD: [f64; 4] = [0.0, 0.375, 0.0, 0.375];

/// The part of the mass at a depth that counts as in front of it.
const OF_OWN: f64 = 0.25;

/// Moments 0 to 4 of the optical depth of a pixel's fragments.
pub type Sums = [f64; 5];

/// The lower bound of the variance and, relative to the variance, of the part of the fourth moment
/// that variance and skewness do not account for.
///
/// Without it, the rounded moments of a nearly transparent pixel may belong to no measure.
const LEAST_SPREAD: f64 = 1e-6;

/// Two standard deviations of the error of a moment of unit mass on the device.
///
/// A moment of up to 1 is rounded eleven times: in four products of a depth, twice where its sum
/// becomes an f32, twice where the mass does, in the division by the mass, and twice in the mixing.
/// Each error is spread evenly over +-u, u = 2^-24, so the standard deviation of all is
/// sqrt(11 / 3) u = 1.9 u. Two of them are 4 u.
const ROUNDING: f64 = 4.0 / 16_777_216.0;

/// Below this optical depth a pixel counts as fully transparent.
const LEAST_MASS: f64 = 1.0 / 65536.0;

/// A measure over depths in [-1, 1], normalised to unit mass about its mean, and its mass.
#[derive(Clone, Copy, Debug)]
pub struct Moments {
    mass: f64,
    /// Moments 1 to 4 of unit mass.
    raw: [f64; 4],
    mean: f64,
    /// Central moments 2 to 4.
    central: [f64; 3],
}

impl Moments {
    /// The measure with the moment sums of a pixel.
    pub fn of([mass, sums @ ..]: Sums) -> Self {
        let b: [f64; 4] = std::array::from_fn(|k| match mass > 0.0 {
            true => sums[k] / mass * (1.0 - MIXED) + SPREAD[k] * MIXED,
            false => SPREAD[k],
        });
        Self::of_unit(mass, b)
    }

    /// The measure of this mass whose moments 1 to 4, for unit mass, are `b`.
    fn of_unit(mass: f64, b: [f64; 4]) -> Self {
        let mean = b[0];
        let second = (b[1] - mean * mean).max(LEAST_SPREAD);
        let third = b[2] - mean * (3.0 * b[1] - 2.0 * mean * mean);
        let fourth = b[3] - mean * (4.0 * b[2] - mean * (6.0 * b[1] - 3.0 * mean * mean));
        Self { mass, raw: b, mean, central: [second, third, fourth] }
    }

    /// The transmittance in front of depth `y`, divided by that in front of the nearest fragment's
    /// depth `first`.
    ///
    /// Both depths are in [-1, 1].
    pub fn let_through(&self, y: f64, first: f64) -> f64 {
        if self.mass < LEAST_MASS {
            return 1.0;
        }
        (-self.mass * (self.before(y) - self.before(first)).max(0.0)).exp()
    }

    /// The sum of the changes of [`let_through`](Self::let_through) when each moment and both
    /// depths change by `ROUNDING`: f32 knows the transmittance no better.
    ///
    /// Fragments close together in a deep scene have central moments far smaller than the rounding
    /// of their moments.
    pub fn unsure(&self, y: f64, first: f64) -> f64 {
        let exact = self.let_through(y, first);
        let change = |changed: &dyn Fn(f64) -> f64| {
            [-ROUNDING, ROUNDING].map(|by| (changed(by) - exact).abs()).into_iter().fold(0.0, f64::max)
        };
        let of_moment = |k: usize| {
            change(&|by| {
                let mut raw = self.raw;
                raw[k] += by;
                Self::of_unit(self.mass, raw).let_through(y, first)
            })
        };
        let of_depths = change(&|by| self.let_through(y + by, first)) + change(&|by| self.let_through(y, first + by));
        (0..4).map(of_moment).sum::<f64>() + of_depths
    }

    /// The part of the mass in front of depth `y`, 0 to 1.
    fn before(&self, y: f64) -> f64 {
        let [second, third, fourth] = self.central;
        let x = y - self.mean;
        // The polynomial whose zeros are the two other depths; at x its value is 1 over the mass
        // there.
        let rest = (fourth - second * second - third * third / second).max(LEAST_SPREAD * second);
        let c2 = (x * x - second - third / second * x) / rest;
        let (c1, c0) = ((x - third * c2) / second, 1.0 - second * c2);
        let own = 1.0 / (c0 + x * (c1 + x * c2));
        // One of the two other depths may be infinitely far away; it has no mass then.
        let c2 = if c2.abs() < 1e-12 { 1e-12 } else { c2 };
        let (half, product) = (-0.5 * c1 / c2, c0 / c2);
        let larger = half + (half * half - product).max(0.0).sqrt().copysign(half);
        let other = product / larger;
        // Solved from total mass 1 and first moment 0.
        let of_larger = (-own * x - other * (1.0 - own)) / (larger - other);
        let of_other = 1.0 - own - of_larger;
        let mut before = OF_OWN * own;
        before += if larger < x { of_larger } else { 0.0 };
        before += if other < x { of_other } else { 0.0 };
        before.clamp(0.0, 1.0)
    }
}

/// Maps a depth to [-1, 1] between the two given depths, clamped.
pub fn place(depth: f64, [first, farthest]: [f64; 2]) -> f64 {
    (2.0 * (depth - first) / (farthest - first) - 1.0).clamp(-1.0, 1.0)
}

/// The f64 twin: each pixel's moments, and its nearest fragment's depth in [-1, 1]. The pixels are
/// those of `strip`.
pub fn reference(strip: &Strip<'_>) -> Vec<(Moments, f64)> {
    let mut sums = vec![([0.0; 5], 1.0); strip.camera.width as usize * strip.rows as usize];
    visit(
        strip,
        |_, _| {},
        |f| {
            let (mut term, place) = (held_back(f.alpha(strip.options)), place(f.depth, strip.depths));
            let (moments, first) = &mut sums[f.pixel];
            *first = f64::min(*first, place);
            for moment in moments {
                *moment += term;
                term *= place;
            }
        },
    );
    sums.into_iter().map(|(sums, first)| (Moments::of(sums), first)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(masses: &[(f64, f64)]) -> Moments {
        let mut sums = [0.0; 5];
        for (mass, place) in masses {
            sums.iter_mut().enumerate().for_each(|(k, sum)| *sum += mass * place.powi(k as i32));
        }
        Moments::of(sums)
    }

    #[test]
    fn moments_of_few_masses_tell_what_lies_between_them() {
        // In front of, between and behind two surfaces.
        let two = of(&[(0.7, -0.4), (1.1, 0.5)]);
        for (place, mass) in [(-0.9, 0.0f64), (0.05, 0.7), (0.95, 1.8)] {
            let shown = two.let_through(place, -1.0);
            assert!((shown - (-mass).exp()).abs() < 0.01, "{place}: {shown}");
        }
        // At its own depth a surface counts with a quarter of its mass. The nearest surface gets
        // all light.
        assert!((two.let_through(-0.4, -1.0) - (-0.25f64 * 0.7).exp()).abs() < 0.01);
        assert_eq!(two.let_through(-0.4, -0.4), 1.0);
        // However dense the pixel is, the nearest fragment has weight 1, and one far behind has
        // almost none.
        let opaque = of(&[(900.0, -0.5), (900.0, 0.5)]);
        assert!(opaque.let_through(-0.5, -0.5) == 1.0 && opaque.let_through(0.5, -0.5) < 1e-100);
        // Far apart, surfaces are told apart to a few digits less than f32 has. Within a
        // thousandth of the scene's depth they are not.
        let [far, close] = [0.9, 0.001].map(|apart| of(&[(0.7, 0.5 - apart), (1.1, 0.5)]).unsure(0.5, 0.5 - apart));
        assert!(far < 1e-4 && close > 3e-4, "{far} {close}");
        // An empty measure lets everything through at every depth, and so does one below the least
        // mass.
        for nothing in [of(&[]), Moments::of([4.0, 4.0, 3.0, 3.0, 3.0].map(|units| units / f64::from(1 << 26)))] {
            assert_eq!([-1.0, 0.0, 1.0].map(|place| nothing.let_through(place, -1.0)), [1.0; 3]);
        }
        // Transmittance decreases with depth, if not by much.
        let many = of(&[(0.2, -0.8), (0.3, -0.3), (0.1, 0.1), (0.5, 0.4), (0.2, 0.9)]);
        let shown: Vec<f64> = (0..=20).map(|step| many.let_through(f64::from(step) / 10.0 - 1.0, -1.0)).collect();
        assert!(shown.windows(2).all(|pair| pair[1] <= pair[0] + 1e-9), "{shown:?}");
        assert!(shown[0] > 0.95 && shown[20] < 0.35);
    }
}
