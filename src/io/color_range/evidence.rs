//! Statistics of colour numbers, from which their range is decided.

use super::{Kind, Numbers, Values};
use rayon::prelude::*;

/// Points per parallel chunk.
const TOGETHER: usize = 1 << 14;

/// Numbers above this magnitude are ignored: they are placeholders for infinity.
const LARGEST: f64 = 1e12;

/// Statistics of the numbers of all channels. Zeros, NaN and magnitudes above [`LARGEST`] only
/// enter `count` and `outside`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::io) struct Evidence {
    /// The number of non-zero numbers.
    pub nonzero: u64,
    /// The counts of numbers above 1, 255 and 65535.
    pub above: [u64; 3],
    /// The count of numbers strictly between 0 and 1, as fractions of white are.
    pub shares: u64,
    /// The counts of 8-bit codes widened to 16 bits: multiples of 257 up to 65535, and multiples of
    /// 256.
    pub widened: [u64; 2],
    /// The count of numbers that are not whole.
    pub fractions: u64,
    /// The count of numbers outside the limits in the header.
    pub outside: u64,
    /// The count of all numbers, including zeros.
    pub count: u64,
    pub largest: f64,
}

impl Evidence {
    pub fn of(numbers: &Numbers) -> Self {
        let Kind { limits, .. } = numbers.kind;
        let add = |mut all: Self, color: [f64; 3]| {
            for (channel, value) in color.into_iter().enumerate() {
                all.add(value);
                let is_outside = |limits: [(f64, f64); 3]| value < limits[channel].0 || value > limits[channel].1;
                all.outside += u64::from(limits.is_some_and(is_outside));
            }
            all
        };
        numbers.fold(add, Self::both)
    }

    /// The statistics of the alphas.
    pub fn of_alphas(numbers: &Numbers) -> Self {
        fn add(mut all: Evidence, alpha: f64) -> Evidence {
            all.add(alpha);
            all
        }
        let of_codes = |codes: &[[u8; 4]]| codes.iter().map(|code| f64::from(code[3])).fold(Self::default(), add);
        let of_floats = |colors: &[[f32; 4]]| colors.iter().map(|color| f64::from(color[3])).fold(Self::default(), add);
        match &numbers.values {
            Values::Bytes(codes) => codes.par_chunks(TOGETHER).map(of_codes).reduce(Self::default, Self::both),
            Values::Floats(colors) => colors.par_chunks(TOGETHER).map(of_floats).reduce(Self::default, Self::both),
            Values::Words(_) => Self::default(),
        }
    }

    fn add(&mut self, value: f64) {
        self.count += 1;
        // A placeholder for infinity says nothing about the range.
        if value == 0.0 || value.is_nan() || value.abs() > LARGEST {
            return;
        }
        self.nonzero += 1;
        self.shares += u64::from(value > 0.0 && value < 1.0);
        for (above, limit) in self.above.iter_mut().zip([1.0, 255.0, 65535.0]) {
            *above += u64::from(value > limit);
        }
        let whole = value.fract() == 0.0;
        self.fractions += u64::from(!whole);
        if whole && (0.0..=65535.0).contains(&value) {
            let code = value as u16;
            self.widened[0] += u64::from(code == 257 * (code >> 8));
            self.widened[1] += u64::from(code & 0xff == 0);
        }
        self.largest = self.largest.max(value);
    }

    pub fn both(self, other: Self) -> Self {
        Self {
            nonzero: self.nonzero + other.nonzero,
            above: [0, 1, 2].map(|k| self.above[k] + other.above[k]),
            shares: self.shares + other.shares,
            widened: [0, 1].map(|k| self.widened[k] + other.widened[k]),
            fractions: self.fractions + other.fractions,
            outside: self.outside + other.outside,
            count: self.count + other.count,
            largest: self.largest.max(other.largest),
        }
    }
}

impl Numbers {
    /// Applies `add` to the colours of all points that have a colour, in parallel, and joins
    /// partial results with `both`. The default value must be neutral for `both`.
    pub(super) fn fold<T: Default + Send>(
        &self,
        add: impl Fn(T, [f64; 3]) -> T + Sync,
        both: impl Fn(T, T) -> T + Sync,
    ) -> T {
        macro_rules! folded {
            ($values:expr, $color:expr) => {
                $values
                    .par_chunks(TOGETHER)
                    .map(|values| values.iter().filter_map($color).fold(T::default(), &add))
                    .reduce(T::default, &both)
            };
        }
        match &self.values {
            Values::Bytes(codes) => folded!(codes, |code: &[u8; 4]| Some([0, 1, 2].map(|k| f64::from(code[k])))),
            Values::Words(codes) => folded!(codes, |code: &[u16; 3]| Some(code.map(f64::from))),
            Values::Floats(colors) => folded!(colors, |color: &[f32; 4]| {
                (!color[0].is_nan()).then(|| [0, 1, 2].map(|k| f64::from(color[k])))
            }),
        }
    }
}
