//! Pseudorandom numbers from a seed, the same on every machine: SplitMix64 (Steele, Lea and Flood
//! 2014).

/// A stream of pseudorandom numbers.
#[derive(Clone, Debug)]
pub(crate) struct Random(u64);

/// The generator's finaliser: mixes all bits of a word.
pub(crate) fn mixed(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The step of the generator's state.
pub(crate) const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

impl Random {
    /// The stream `number` of a seed.
    pub(crate) fn stream(seed: u64, number: u64) -> Self {
        let mut first = Self(seed);
        let base = first.bits();
        Self(base ^ Self(number).bits())
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(STEP);
        mixed(self.0)
    }

    /// The next number of the stream, in [0, 1).
    pub(crate) fn number(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
}
