//! A share of a scene, for pictures that several processes draw together.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Share number `number` of `of` equal shares of a scene's surfels.
///
/// A share is a part of the order in which devices store surfels
/// ([`order`](crate::passes::order)). That order consists of short runs that lie together in space,
/// and neighbouring runs lie far apart. So all shares have a like part of what is near and far,
/// visible and hidden. No bit of a picture depends on how surfels are shared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Share {
    /// Number of shares.
    of: u32,
    /// Number of this share, from 1.
    number: u32,
}

/// Pieces of a share of a file.
pub const PIECES: u32 = 32;

/// Large shares begin at multiples of this many surfels, so that batches are whole
/// ([`BATCH`](crate::gpu::layout::BATCH)).
const WHOLE: usize = 64;
const _: () = assert!(WHOLE.is_multiple_of(crate::gpu::layout::BATCH as usize));

/// The most shares of a scene.
pub const MOST_SHARES: u32 = 65_536;

impl Share {
    /// Share `number` of `of`.
    ///
    /// # Errors
    /// [`Error::Usage`] unless 1 <= `number` <= `of` <= [`MOST_SHARES`].
    pub fn new(number: u32, of: u32) -> Result<Self> {
        if of == 0 || of > MOST_SHARES {
            return Err(Error::Usage(format!("a picture has 1 to {MOST_SHARES} parts, not {of}")));
        }
        if !(1..=of).contains(&number) {
            return Err(Error::Usage(format!("the parts are 1/{of} to {of}/{of}, and {number}/{of} is none of them")));
        }
        Ok(Self { of, number })
    }

    /// Number of this share, from 1.
    pub fn number(self) -> u32 {
        self.number
    }

    /// Number of shares.
    pub fn of(self) -> u32 {
        self.of
    }

    /// The places of this share among `count` surfels in stored order. The shares cover all places
    /// without overlap.
    pub fn range(self, count: usize) -> Range<usize> {
        let is_large = count / self.of as usize >= WHOLE * WHOLE;
        let end = |number: u32| {
            let end = (count as u128 * u128::from(number) / u128::from(self.of)) as usize;
            if is_large && end < count { end / WHOLE * WHOLE } else { end }
        };
        end(self.number - 1)..end(self.number)
    }

    /// The places of this share among `count` surfels of a file whose neighbours are neighbours in
    /// space: [`PIECES`] runs from everywhere. The shares cover all places without overlap.
    pub fn pieces(self, count: usize) -> impl Iterator<Item = Range<usize>> + Clone {
        let all = u128::from(self.of) * u128::from(PIECES);
        let end = move |piece: u128| (count as u128 * piece / all) as usize;
        (0..PIECES).map(move |turn| {
            let piece = u128::from(turn) * u128::from(self.of) + u128::from(self.number - 1);
            end(piece)..end(piece + 1)
        })
    }
}

impl fmt::Display for Share {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Share {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let numbers = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        let (number, of) = numbers
            .ok_or_else(|| Error::Usage(format!("a part is I/N, such as 1/4 for the first of four, not {text:?}")))?;
        Self::new(number, of)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn shares_cover_everything_once() {
        for (count, of) in [(0, 3), (1, 1), (2, 5), (10, 3), (1_000_003, 64), (usize::MAX, 1000)] {
            let shares = (1..=of).map(|number| Share::new(number, of).unwrap());
            let least = count / of as usize;
            let pieces = shares.clone().flat_map(|share| share.pieces(count));
            let ranges = shares.map(|share| share.range(count));
            let covers = |mut all: Vec<Range<usize>>| {
                all.sort_by_key(|own| (own.start, own.end));
                let mut end = 0;
                for own in all {
                    assert!(own.start == end && own.end >= end);
                    end = own.end;
                }
                assert_eq!(end, count);
            };
            assert!(ranges.clone().all(|range| range.len().abs_diff(least) <= WHOLE), "{of}");
            covers(ranges.collect());
            covers(pieces.collect());
        }
        // Pieces of one share lie everywhere.
        let pieces: Vec<_> = Share::new(2, 3).unwrap().pieces(960).collect();
        assert_eq!((pieces.len(), pieces[0].clone(), pieces[31].clone()), (32, 10..20, 940..950));
    }

    #[test]
    fn shares_are_read_as_they_are_written() {
        let share: Share = "3/7".parse().unwrap();
        assert_eq!((share.number(), share.of(), share.to_string().as_str()), (3, 7, "3/7"));
        for bad in ["", "3", "0/7", "8/7", "1/0", "a/b", "1/65537", "-1/2", "1/2/3"] {
            assert!(bad.parse::<Share>().is_err(), "{bad}");
        }
    }
}
