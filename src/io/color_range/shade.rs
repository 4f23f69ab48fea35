//! Conversion of intensities to grey.

use super::Shades;
use super::apply::default_code;
use rayon::prelude::*;

/// The intensities that become black and white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shading {
    pub black: f64,
    pub white: f64,
}

/// A histogram of the intensities of all inputs.
#[derive(Clone, Debug, Default)]
pub(super) struct Levels {
    /// Counts of the whole numbers from 0 to 65535; empty until intensities are added.
    words: Vec<u64>,
    /// All other finite values.
    others: Vec<f32>,
}

impl Shades {
    /// Index of the group that is scaled together: 0 for integers, 1 for floats.
    pub(super) fn class(&self) -> usize {
        match self {
            Self::Words(_) | Self::Floats { integer: true, .. } => 0,
            Self::Floats { .. } => 1,
        }
    }

    /// Grey codes with alpha 255; the default colour for points without an intensity.
    pub(super) fn grey(&self, shading: Shading) -> Vec<[u8; 4]> {
        let Shading { black, white } = shading;
        let default = default_code();
        let code = |value: f64| {
            if value.is_nan() {
                return default;
            }
            // The cast saturates values outside 0 to 255.
            let code = ((value - black) / (white - black) * 255.0).round() as u8;
            [code, code, code, 255]
        };
        match self {
            Self::Words(values) => values.par_iter().map(|value| code((*value).into())).collect(),
            Self::Floats { values, .. } => values.par_iter().map(|value| code((*value).into())).collect(),
        }
    }
}

impl Levels {
    pub fn is_empty(&self) -> bool {
        self.words.is_empty() && self.others.is_empty()
    }

    pub fn add(&mut self, shades: &Shades) {
        self.words.resize(1 << 16, 0);
        match shades {
            Shades::Words(values) => values.iter().for_each(|value| self.words[usize::from(*value)] += 1),
            Shades::Floats { values, .. } => {
                for &value in values.iter().filter(|value| value.is_finite()) {
                    match value as u16 {
                        word if f32::from(word) == value => self.words[usize::from(word)] += 1,
                        _ => self.others.push(value),
                    }
                }
            }
        }
    }

    /// Chooses black and white. None if all intensities are equal.
    ///
    /// White is the 99.9th percentile, so that a few glints do not darken the rest. Black is zero,
    /// or the 0.1th percentile if some intensities are negative.
    pub fn shading(&self) -> Option<Shading> {
        let mut others = self.others.clone();
        others.par_sort_unstable_by(f32::total_cmp);
        let of_words = self.words.iter().enumerate().filter(|(_, count)| **count > 0);
        let of_words = of_words.map(|(word, count)| (word as f64, *count));
        let mut of_words = of_words.peekable();
        let mut of_others = others.iter().map(|other| f64::from(*other)).peekable();
        // All levels in ascending order, with their counts.
        let ascending = std::iter::from_fn(|| match (of_words.peek(), of_others.peek()) {
            (Some((word, _)), Some(other)) if other < word => of_others.next().map(|other| (other, 1)),
            (None, Some(_)) => of_others.next().map(|other| (other, 1)),
            _ => of_words.next(),
        });
        let ascending: Vec<(f64, u64)> = ascending.collect();
        let (least, most) = (ascending.first()?.0, ascending.last()?.0);
        if least == most {
            return None;
        }
        let count: u64 = ascending.iter().map(|(_, count)| count).sum();
        let at = |share: f64| {
            let rank = ((share * count as f64).ceil() as u64).max(1);
            let mut below = 0;
            let found = ascending.iter().find(|(_, count)| {
                below += count;
                below >= rank
            });
            found.map_or(most, |(level, _)| *level)
        };
        let black = if least < 0.0 { at(0.001) } else { 0.0 };
        // If nearly all intensities are at most black, the next larger one is white.
        let next = || ascending.iter().map(|(level, _)| *level).find(|level| *level > black);
        let white = Some(at(0.999)).filter(|white| *white > black).or_else(next)?;
        Some(Shading { black, white })
    }
}
