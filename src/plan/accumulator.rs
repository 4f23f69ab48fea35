//! The accumulators: formats of the sums on the device. For the cost and error of each, see
//! `src/passes/accumulate.rs`.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use super::Settings;
use crate::error::Error;
use crate::gpu::layout::ONE;
use crate::scene::kernel::LEAST_AT_RIM;

/// The format of sums on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Accumulator {
    /// Fixed point, two u32 words per sum: the default.
    #[default]
    Fixed,
    /// Fixed point, one u32 word per sum.
    Fixed32,
    /// Fixed point, one u64 per sum.
    Fixed64,
    /// Fixed point, two sums in one u64.
    Packed64,
    /// f32, by atomic add.
    Float,
    /// f32, by compare and exchange.
    Cas,
}

impl Accumulator {
    /// Its row in [`ACCUMULATORS`].
    pub fn row(self) -> &'static AccumulatorRow {
        // The table has its rows in the order of the enum; a test checks it.
        &ACCUMULATORS[self as usize]
    }

    /// Its name on the command line and in reports.
    pub fn name(self) -> &'static str {
        self.row().name
    }
}

impl fmt::Display for Accumulator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Accumulator {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl FromStr for Accumulator {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        ACCUMULATORS.iter().find(|row| row.name == text).map(|row| row.of).ok_or_else(|| {
            let names = ACCUMULATORS.iter().map(|row| row.name).collect::<Vec<_>>().join(", ");
            Error::Usage(format!("there is no accumulator {text:?}: take one of {names}"))
        })
    }
}

/// Properties of an accumulator: a row of [`ACCUMULATORS`] and a file `wgsl/accumulator_*.wgsl`.
#[derive(Debug)]
pub struct AccumulatorRow {
    /// The accumulator.
    pub of: Accumulator,
    /// Its name on the command line and in reports.
    pub name: &'static str,
    /// Name of its WGSL file.
    pub file: &'static str,
    /// u32 words of one sum.
    pub words: u32,
    /// Whether the image is bit-identical for any order of fragments.
    pub deterministic: bool,
    /// The features that it needs beyond core WebGPU.
    pub features: Features,
    /// Bound on the error of a mean over n fragments of summed weight w with `bits` fraction bits,
    /// as a fraction of the value range.
    pub error_bound: fn(n: f64, w: f64, bits: u32) -> f64,
}

/// Optional features of an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Features {
    /// None: core WebGPU is enough.
    None,
    /// 64-bit integers and atomics.
    AtomicsU64,
    /// f32 atomic add.
    AtomicsF32,
}

/// The unit roundoff of f32, 2^-24.
const U: f64 = 1.0 / 16_777_216.0;

/// Every accumulator, in the order of [`Accumulator`]; the first is the default.
pub const ACCUMULATORS: &[AccumulatorRow] = &[
    AccumulatorRow {
        of: Accumulator::Fixed,
        name: "fixed",
        file: "accumulator_fixed.wgsl",
        words: 2,
        deterministic: true,
        features: Features::None,
        error_bound: |n, w, _| n / (ONE as f64 * w) + 6.0 * U,
    },
    AccumulatorRow {
        of: Accumulator::Fixed32,
        name: "fixed32",
        file: "accumulator_fixed32.wgsl",
        words: 1,
        deterministic: true,
        features: Features::None,
        error_bound: |n, w, bits| n * (-f64::from(bits)).exp2() / w + 5.0 * U,
    },
    AccumulatorRow {
        of: Accumulator::Fixed64,
        name: "fixed64",
        file: "accumulator_fixed64.wgsl",
        words: 2,
        deterministic: true,
        features: Features::AtomicsU64,
        error_bound: |n, w, _| n * (-40f64).exp2() / w + 6.0 * U,
    },
    AccumulatorRow {
        of: Accumulator::Packed64,
        name: "packed64",
        file: "accumulator_packed64.wgsl",
        words: 1,
        deterministic: true,
        features: Features::AtomicsU64,
        error_bound: |n, w, bits| n * (-f64::from(bits)).exp2() / w + 5.0 * U,
    },
    AccumulatorRow {
        of: Accumulator::Float,
        name: "float",
        file: "accumulator_float.wgsl",
        words: 1,
        deterministic: false,
        features: Features::AtomicsF32,
        error_bound: |n, _, _| 2.0 * n * U + 4.0 * U,
    },
    AccumulatorRow {
        of: Accumulator::Cas,
        name: "cas",
        file: "accumulator_cas.wgsl",
        words: 1,
        deterministic: false,
        features: Features::None,
        error_bound: |n, _, _| 2.0 * n * U + 4.0 * U,
    },
];

impl AccumulatorRow {
    /// Number of u32 words before the sums, which count the sums that wrapped; 0 if sums cannot
    /// wrap.
    pub fn head_words(&self) -> u64 {
        if matches!(self.of, Accumulator::Fixed32 | Accumulator::Packed64) { 2 } else { 0 }
    }

    /// Fraction bits of a one-word sum in a scene of `surfels`: as many as `surfels` full weights
    /// leave free, or 255 full weights in a larger scene.
    pub fn fraction_bits(&self, surfels: u64) -> u32 {
        let most = surfels.clamp(1, 255) as u32;
        32 - (32 - most.leading_zeros())
    }
}

/// Returns the fraction bits per term of `fixed64`, and of `fixed` if terms may be small.
///
/// The result is 40 unless small weights matter. Where they do, it is up to 56: as many bits as the
/// weights of all `surfels` leave free in a 64-bit sum. Kernels that fall below [`LEAST_AT_RIM`]
/// get at least 40, so that a pixel reached only by their tails keeps its digits. Order-free
/// composites ([`Oit`](super::Oit)) give far fragments small weights, and need the digits where
/// only these show. Because they sum all fragments of a pixel, they leave room for every surfel,
/// even if fewer than 40 bits remain.
pub fn wide_bits(options: &Settings, surfels: u64) -> u32 {
    if options.composite.is_order_free() {
        surfels.leading_zeros().min(56)
    } else if options.kernel.floor() < LEAST_AT_RIM {
        surfels.leading_zeros().clamp(40, 56)
    } else {
        40
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Composite, Kernel};

    #[test]
    fn every_accumulator_has_its_row_its_file_and_its_own_name() {
        for row in ACCUMULATORS {
            assert_eq!(row.of.row().name, row.name);
            assert!(crate::gpu::sources::FILES.iter().any(|(name, _)| *name == row.file), "{}", row.file);
            assert_eq!(row.name.parse::<Accumulator>().ok(), Some(row.of));
        }
        assert!("double".parse::<Accumulator>().is_err());
    }

    #[test]
    fn wide_bits_leave_room_for_every_surfel_and_24_digits_to_the_least_weight_of_few() {
        let of = |a: f64| Settings { kernel: Kernel::Ellipse { a, n: 3.0, smooth: false }, ..Default::default() };
        let far = Settings { composite: Composite::Weighted, ..of(6.0) };
        for (surfels, bits) in
            [(0, 56), (255, 56), (256, 55), (65_535, 48), (1_000_000, 44), (1 << 24, 40), (u32::MAX.into(), 40)]
        {
            assert_eq!(wide_bits(&of(20.0), surfels), bits, "{surfels}");
            assert!(u128::from(surfels) << bits < 1 << 64 || bits == 40);
            assert_eq!(wide_bits(&of(6.0), surfels), 40);
            let of_far = wide_bits(&far, surfels);
            assert!(u128::from(surfels) << of_far < 1 << 64 && (of_far == bits || surfels >= 1 << 24));
        }
    }

    #[test]
    fn fraction_bits_leave_room_for_every_surfel() {
        for (surfels, bits) in [(0, 31), (1, 31), (2, 30), (3, 30), (4, 29), (127, 25), (128, 24), (1_000_000_000, 24)]
        {
            assert_eq!(ACCUMULATORS[1].fraction_bits(surfels), bits, "{surfels}");
        }
    }
}
