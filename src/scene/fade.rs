//! Fades between cuts through levels of detail: the share of a surfel while its cut is replaced by
//! a coarser or finer one.

/// The number of cuts that fade into each other, one for each dither threshold.
///
/// Cut n divides the nodes whose size in the image is at least `(1 + n / STEPS) / 2` of the
/// requested size ([`Detail`](super::Detail)), so lower numbers are finer.
pub const STEPS: u8 = 64;

/// The range `from..to` of the [`STEPS`] fading cuts that contain a surfel.
///
/// The weights of its fragments are multiplied by `(to - from) / STEPS`. Depths have no weights:
/// each sample of the image belongs to the cut with the number of its
/// [`threshold`](Self::threshold), and takes the nearest depth of that cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fade {
    /// The first cut.
    pub(crate) from: u8,
    /// One past the last cut.
    pub(crate) to: u8,
}

impl Fade {
    /// A surfel in all cuts.
    pub const WHOLE: Self = Self { from: 0, to: STEPS };

    /// The fraction of the cuts that contain the surfel, 0 to 1.
    pub fn weight(self) -> f64 {
        f64::from(self.to.saturating_sub(self.from)) / f64::from(STEPS)
    }

    /// Whether the surfel is in the cut of the sample at column `x` and row `y`.
    pub fn takes(self, x: u32, y: u32) -> bool {
        (self.from..self.to).contains(&Self::threshold(x, y))
    }

    /// The number of the cut of a sample (the ordered dither of Bayer 1973). Each number occurs
    /// once in 8 x 8 samples, and the numbers in any aligned square are evenly spaced.
    pub fn threshold(x: u32, y: u32) -> u8 {
        let digit = |k: u32| {
            let (column, row) = (x >> k & 1, y >> k & 1);
            ((column ^ row) << 1 | row) << (4 - 2 * k)
        };
        (digit(0) | digit(1) | digit(2)) as u8
    }

    /// Packs the range into one word for the kernels: `from | to << 8`.
    pub fn word(self) -> u32 {
        u32::from(self.from) | u32::from(self.to) << 8
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_spread_in_squares_of_any_size() {
        let spread = |side: u32, x: u32, y: u32| {
            let mut all: Vec<u8> = (0..side * side).map(|k| Fade::threshold(x + k % side, y + k / side)).collect();
            all.sort_unstable();
            all.windows(2).map(|pair| pair[1] - pair[0]).min()
        };
        for (side, least) in [(2, 16), (4, 4), (8, 1)] {
            for (x, y) in [(0, 0), (side, 0), (3 * side, 5 * side)] {
                assert_eq!(spread(side, x, y), Some(least), "{side} {x} {y}");
            }
        }
        assert!(Fade::threshold(9, 8) == Fade::threshold(1, 0) && Fade::threshold(1, 0) != Fade::threshold(0, 1));
    }

    #[test]
    fn parts_that_follow_each_other_take_each_sample_once() {
        let parts =
            [Fade { from: 0, to: 7 }, Fade { from: 7, to: 7 }, Fade { from: 7, to: 40 }, Fade { from: 40, to: 64 }];
        for k in 0..64 {
            assert_eq!(parts.iter().filter(|part| part.takes(k % 8, k / 8)).count(), 1);
        }
        assert!((parts.iter().map(|part| part.weight()).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(Fade::WHOLE.weight() == 1.0 && Fade::WHOLE.word() == 0x4000);
    }
}
