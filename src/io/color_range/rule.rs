//! The rule that decides the range of numbers from their type, the header's limits and the values.

use super::evidence::Evidence;
use super::{Kind, Number};

/// How colour numbers are converted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Rule {
    /// 8-bit sRGB codes; larger numbers become 255.
    Bytes,
    /// 8-bit sRGB codes in the upper bytes of 16-bit numbers.
    HighBytes,
    /// sRGB codes, with the (black, white) of each channel.
    Codes([(f64, f64); 3]),
    /// Linear light.
    Light,
}

/// At most 1 of this many numbers may be an outlier.
const FEW: u64 = 100;

/// Limits from 0 to this or more are ignored if the values are 8-bit, which would be nearly black.
const WIDE: f64 = 4095.0;

/// Whether there are few enough outliers.
fn few(outliers: u64, all: u64) -> bool {
    FEW * outliers <= all
}

impl Rule {
    /// Decides the rule from the statistics of all numbers of a kind.
    pub fn of(kind: &Kind, evidence: &Evidence) -> Self {
        let by_limits = kind.limits.and_then(|limits| Self::of_limits(limits, kind.number, evidence));
        by_limits.unwrap_or_else(|| match kind.number {
            Number::Byte => Self::Bytes,
            Number::Integer(largest) => Self::of_integers(largest, evidence),
            Number::Whole if evidence.nonzero > 0 && evidence.above[0] == 0 => Self::Codes([(0.0, 1.0); 3]),
            Number::Whole => Self::of_integers(u32::MAX.into(), evidence),
            Number::Float => Self::of_floats(kind.light, evidence),
        })
    }

    /// The rule by the header's limits. None if the values contradict them.
    fn of_limits(limits: [(f64, f64); 3], number: Number, evidence: &Evidence) -> Option<Self> {
        let largest = limits.iter().map(|(_, high)| *high).fold(0.0, f64::max);
        let from_zero = limits.iter().all(|(low, _)| *low == 0.0);
        if !few(evidence.outside, evidence.count) {
            return None;
        }
        if from_zero && largest >= WIDE && few(evidence.above[1], evidence.nonzero) {
            return None;
        }
        let is_float = number == Number::Float;
        if is_float && from_zero && largest >= 255.0 && evidence.above[0] == 0 && evidence.fractions > 0 {
            return None;
        }
        Some(match limits {
            limits if is_float && limits == [(0.0, 1.0); 3] => return None,
            limits if limits == [(0.0, 255.0); 3] && evidence.fractions == 0 => Self::Bytes,
            limits if limits == [(0.0, 65535.0); 3] && is_widened(evidence) => Self::HighBytes,
            limits => Self::Codes(limits),
        })
    }

    fn of_integers(largest: u64, evidence: &Evidence) -> Self {
        if few(evidence.above[1], evidence.nonzero) {
            Self::Bytes
        } else if few(evidence.above[2], evidence.nonzero) {
            if is_widened(evidence) { Self::HighBytes } else { Self::Codes([(0.0, 65535.0); 3]) }
        } else {
            Self::Codes([(0.0, largest as f64); 3])
        }
    }

    fn of_floats(light: bool, evidence: &Evidence) -> Self {
        match full_of_floats(evidence) {
            full if full == 255.0 && evidence.fractions == 0 => Self::Bytes,
            full if full == 1.0 && light => Self::Light,
            full => Self::Codes([(0.0, full); 3]),
        }
    }

    /// The number that means white, for each channel.
    pub fn white(&self) -> [f64; 3] {
        match self {
            Self::Bytes => [255.0; 3],
            Self::HighBytes => [65535.0; 3],
            Self::Codes(limits) => limits.map(|(_, high)| high),
            Self::Light => [1.0; 3],
        }
    }

    /// A description of the numbers for users.
    pub fn describe(&self, kind: &Kind) -> String {
        let of = match kind.number {
            Number::Byte => "",
            Number::Integer(_) | Number::Whole => " in wider integers",
            Number::Float => " in floats",
        };
        match self {
            Self::Bytes => format!("8-bit sRGB{of}"),
            Self::HighBytes => "8-bit sRGB, widened to 16 bits".into(),
            Self::Codes(limits) if *limits == [(0.0, 65535.0); 3] => {
                format!("16-bit sRGB{}", of.replace(" in wider integers", ""))
            }
            Self::Codes([(low, high), ..]) => format!("sRGB from {low} to {high}{of}"),
            Self::Light => "float, linear light".into(),
        }
    }
}

/// Whether the numbers are 8-bit codes widened to 16 bits: nearly all are multiples of 257, or
/// nearly all are multiples of 256.
fn is_widened(evidence: &Evidence) -> bool {
    let all = evidence.nonzero;
    evidence.widened.iter().any(|widened| few(all - widened.min(&all), all))
}

/// The float that is white: 1, 255 or 65535.
fn full_of_floats(evidence: &Evidence) -> f64 {
    let Evidence { nonzero, above, shares, largest, .. } = *evidence;
    if largest < 2.0 || above[0] <= shares {
        1.0
    } else if few(above[1], nonzero) {
        255.0
    } else {
        65535.0
    }
}

/// How alphas become opacities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AlphaRule {
    /// The number that is opaque.
    pub full: f64,
    /// Whether all alphas are whole numbers from 0 to 255.
    pub bytes: bool,
    /// The largest alpha of all.
    pub largest: f64,
}

impl AlphaRule {
    pub const BYTES: Self = Self { full: 255.0, bytes: true, largest: 255.0 };

    pub fn of(number: Number, evidence: &Evidence) -> Self {
        let Evidence { nonzero, above, fractions, largest, .. } = *evidence;
        let full = match number {
            Number::Byte => 255.0,
            Number::Integer(_) if few(above[1], nonzero) => 255.0,
            Number::Integer(_) if few(above[2], nonzero) => 65535.0,
            Number::Integer(full) => full as f64,
            Number::Whole | Number::Float => full_of_floats(evidence),
        };
        Self { full, bytes: full == 255.0 && fractions == 0, largest }
    }

    /// Alphas are doubtful if they are whole numbers of at most this, of 255: they look like class
    /// numbers.
    const FAINT: f64 = 31.0;

    /// Whether all alphas are so small that they can hardly be opacities.
    pub fn is_doubtful(&self) -> bool {
        self.bytes && self.largest <= Self::FAINT
    }
}
