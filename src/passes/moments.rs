//! Stage 2 of [`Composite::Moments`](crate::scene::Composite::Moments): what the fragments of a pixel hold back, as a measure over depth,
//! told by its first moments (Münstermann, Krumpen, Klein and Peters 2018, Moment-based order-independent transparency).
//!
//! A fragment of alpha a at the place y in [-1, 1] of the scene's depths adds `h y^k`, `h = -ln(1 - a)`, to the moments k = 0 to 4. Of
//! all measures with these moments the one with mass at a given place x has it at two others too (the canonical representation: the
//! zeros of the second orthogonal polynomial through x), and no measure has less before x than that, nor more up to and with x. What is taken to
//! lie before x is the mass before it and a quarter of that at x (theirs, section 3.2), and lets through `exp` of minus that.
//!
//! A fragment is weighed by what is let through to it of what is let through to the nearest one, whose own weight is then not less however much the pixel
//! holds back: colours are means, so what all weights of a pixel have in common cancels.
//!
//! Moments are sums of integers of 64 bits in units of 2^-26, so the order of fragments shows nowhere; theirs are of floats. As
//! f32 leaves little of nearly degenerate moments, a part of 2^-14 of a spread measure is mixed in, as theirs of 16 bits have and a hundred times as much
//! as theirs of floats. Depths are not warped by a logarithm, as the places are those of the scene's body and not of clip planes.

use super::Strip;
use super::oit::{held_back, visit};
use crate::plan::steps::Clear;
use crate::plan::{Oit, Plan};

/// Words of a pixel: two a moment.
pub const MOMENT_WORDS: u32 = 10;

/// The part of the spread measure that is mixed in.
const MIXED: f64 = 1.0 / 16384.0;

/// Its moments 1 to 4.
const SPREAD: [f64; 4] = [0.0, 0.375, 0.0, 0.375];

/// Of the mass at a place what counts as before it.
const OF_OWN: f64 = 0.25;

/// Moments 0 to 4 of what a pixel's fragments hold back.
pub type Sums = [f64; 5];

/// Neither variance nor what of the fourth moment skewness leaves is less: rounded moments of what hardly holds anything back may be those of no
/// measure.
const LEAST_SPREAD: f64 = 1e-6;

/// Of less mass nothing before anything shows.
const LEAST_MASS: f64 = 1.0 / 65536.0;

/// A measure of unit mass about its mean, and the mass.
#[derive(Clone, Copy, Debug)]
pub struct Moments {
    mass: f64,
    mean: f64,
    /// Central moments 2 to 4.
    central: [f64; 3],
}

impl Moments {
    /// Of the sums of a pixel.
    pub fn of([mass, sums @ ..]: Sums) -> Self {
        let b: [f64; 4] = std::array::from_fn(|k| match mass > 0.0 {
            true => sums[k] / mass * (1.0 - MIXED) + SPREAD[k] * MIXED,
            false => SPREAD[k],
        });
        let mean = b[0];
        let second = (b[1] - mean * mean).max(LEAST_SPREAD);
        let third = b[2] - mean * (3.0 * b[1] - 2.0 * mean * mean);
        let fourth = b[3] - mean * (4.0 * b[2] - mean * (6.0 * b[1] - 3.0 * mean * mean));
        Self { mass, mean, central: [second, third, fourth] }
    }

    /// What is let through to the place `y` in [-1, 1], of what is let through to the nearest one, `first`.
    pub fn let_through(&self, y: f64, first: f64) -> f64 {
        if self.mass < LEAST_MASS {
            return 1.0;
        }
        (-self.mass * (self.before(y) - self.before(first)).max(0.0)).exp()
    }

    /// The part of the mass that counts as before the place `y`.
    fn before(&self, y: f64) -> f64 {
        let [second, third, fourth] = self.central;
        let x = y - self.mean;
        // The polynomial whose zeros are the other two places; at x it is one over the mass there.
        let rest = (fourth - second * second - third * third / second).max(LEAST_SPREAD * second);
        let c2 = (x * x - second - third / second * x) / rest;
        let (c1, c0) = ((x - third * c2) / second, 1.0 - second * c2);
        let own = 1.0 / (c0 + x * (c1 + x * c2));
        // One of them may be infinitely far, where it has no mass.
        let c2 = if c2.abs() < 1e-12 { 1e-12 } else { c2 };
        let (half, product) = (-0.5 * c1 / c2, c0 / c2);
        let larger = half + (half * half - product).max(0.0).sqrt().copysign(half);
        let other = product / larger;
        // Of all mass 1 and the first moment 0.
        let of_larger = (-own * x - other * (1.0 - own)) / (larger - other);
        let of_other = 1.0 - own - of_larger;
        let mut before = OF_OWN * own;
        before += if larger < x { of_larger } else { 0.0 };
        before += if other < x { of_other } else { 0.0 };
        before.clamp(0.0, 1.0)
    }
}

/// The place in [-1, 1] of a depth between two.
pub fn place(depth: f64, [first, farthest]: [f64; 2]) -> f64 {
    (2.0 * (depth - first) / (farthest - first) - 1.0).clamp(-1.0, 1.0)
}

/// The twin: the moments of the pixels of `strip`, and the place of the nearest fragment of each.
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

/// What is cleared before moments are summed.
pub fn clears(plan: &Plan, band: usize) -> Option<Clear> {
    let words = u64::from(MOMENT_WORDS) * plan.bands[band].pixels;
    (plan.needs.oit == Some(Oit::Moments)).then(|| Clear::of("moments", 0, words))
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
        // Before, between and behind two surfaces.
        let two = of(&[(0.7, -0.4), (1.1, 0.5)]);
        for (place, mass) in [(-0.9, 0.0f64), (0.05, 0.7), (0.95, 1.8)] {
            let shown = two.let_through(place, -1.0);
            assert!((shown - (-mass).exp()).abs() < 0.01, "{place}: {shown}");
        }
        // At one a quarter of its own, of which the nearest one has nothing before it.
        assert!((two.let_through(-0.4, -1.0) - (-0.25f64 * 0.7).exp()).abs() < 0.01);
        assert_eq!(two.let_through(-0.4, -0.4), 1.0);
        // However much is held back the nearest fragment weighs, and what is far behind does not.
        let opaque = of(&[(900.0, -0.5), (900.0, 0.5)]);
        assert!(opaque.let_through(-0.5, -0.5) == 1.0 && opaque.let_through(0.5, -0.5) < 1e-100);
        // Nothing holds nothing back, wherever it is asked, nor does what is too faint to tell.
        for nothing in [of(&[]), Moments::of([4.0, 4.0, 3.0, 3.0, 3.0].map(|units| units / f64::from(1 << 26)))] {
            assert_eq!([-1.0, 0.0, 1.0].map(|place| nothing.let_through(place, -1.0)), [1.0; 3]);
        }
        // Less is let through farther back, if not by much less.
        let many = of(&[(0.2, -0.8), (0.3, -0.3), (0.1, 0.1), (0.5, 0.4), (0.2, 0.9)]);
        let shown: Vec<f64> = (0..=20).map(|step| many.let_through(f64::from(step) / 10.0 - 1.0, -1.0)).collect();
        assert!(shown.windows(2).all(|pair| pair[1] <= pair[0] + 1e-9), "{shown:?}");
        assert!(shown[0] > 0.95 && shown[20] < 0.35);
    }
}
