//! Numbers that depend on a seed alone: splitmix64 (Steele, Lea and Flood 2014).

/// The generator's state.
pub struct Random(pub u64);

impl Random {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number less than `bound`; 0 for a bound of 0.
    pub fn below(&mut self, bound: usize) -> usize {
        (self.bits() >> 11) as usize % bound.max(1)
    }

    /// True once in `n` times.
    pub fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// One of some choices.
    pub fn pick<'a, T: ?Sized>(&mut self, choices: &[&'a T]) -> &'a T {
        choices[self.below(choices.len())]
    }

    /// Between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A count: often few, at most `most`.
    pub fn count(&mut self, most: usize) -> usize {
        match self.below(8) {
            0 => self.below(2),
            1..=4 => self.below(most.min(8) + 1),
            _ => self.below(most + 1),
        }
    }
}

/// Where the points of a generated file lie.
#[derive(Clone, Copy)]
pub enum Place {
    /// In the unit cube.
    Unit,
    /// On a coarse grid, so that positions repeat.
    Grid,
    /// Far from the origin, as surveys are.
    Survey,
    /// All at one place.
    One,
    /// Of all magnitudes, numbers that are none among them.
    Wild,
}

/// Coordinates at the limits of the types and of what a scene may hold.
const WILD: [f64; 12] =
    [0.0, -0.0, 1e-320, 1e-40, 1e18, -1.1e18, 3.5e38, 1e300, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 2147483648.0];

impl Place {
    /// One of them.
    pub fn any(random: &mut Random) -> Self {
        [Self::Unit, Self::Unit, Self::Grid, Self::Survey, Self::One, Self::Wild][random.below(6)]
    }

    /// A point there.
    pub fn point(self, random: &mut Random) -> [f64; 3] {
        [0, 1, 2].map(|axis| match self {
            Self::Unit => random.between(-1.0, 1.0),
            Self::Grid => random.below(3) as f64,
            Self::Survey => [5e5, 6e6, 0.0][axis] + (random.between(0.0, 1e5)).round() / 1000.0,
            Self::One => 7.5,
            Self::Wild if random.one_in(2) => WILD[random.below(WILD.len())],
            Self::Wild => random.between(-1.0, 1.0) * 10f64.powf(random.between(-30.0, 30.0)),
        })
    }
}
