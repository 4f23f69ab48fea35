//! How much of a surfel there is while a coarser or a finer cut of levels of detail takes over from the one that it is in.

/// Cuts that fade into each other: as many as there are thresholds of samples. That of a number n is a cut by the n-th of so many sizes, evenly
/// far from each other, from half of that which is asked for on ([`Detail`](super::Detail)); so those of the first numbers are finest.
pub const STEPS: u8 = 64;

/// Which of the [`STEPS`] cuts that fade into each other a surfel is in: those whose numbers lie in `from..to`.
///
/// Its fragments weigh as many parts of [`STEPS`] as these are. Depths have no weights: each sample of the image has a number, its
/// [`threshold`](Self::threshold), and its nearest depth is that of the cut with this number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fade {
    /// The first.
    pub(crate) from: u8,
    /// One more than the last.
    pub(crate) to: u8,
}

impl Fade {
    /// In all of them.
    pub const WHOLE: Self = Self { from: 0, to: STEPS };

    /// The part of all cuts, 0 to 1.
    pub fn weight(self) -> f64 {
        f64::from(self.to.saturating_sub(self.from)) / f64::from(STEPS)
    }

    /// Whether it is in the cut of the sample in this column and row.
    pub fn takes(self, x: u32, y: u32) -> bool {
        (self.from..self.to).contains(&Self::threshold(x, y))
    }

    /// The number of the cut of a sample: each once in eight by eight of them, such that those of any aligned square are evenly far from each
    /// other (the ordered dither of Bayer 1973).
    pub fn threshold(x: u32, y: u32) -> u8 {
        let digit = |k: u32| {
            let (column, row) = (x >> k & 1, y >> k & 1);
            ((column ^ row) << 1 | row) << (4 - 2 * k)
        };
        (digit(0) | digit(1) | digit(2)) as u8
    }

    /// In one word, as kernels have it.
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
