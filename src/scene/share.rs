//! A share of a scene, for pictures that several processes draw together.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Share number `number` of `of` equal shares of a scene's surfels.
///
/// A share is [`PIECES`] pieces of the curve along which devices store surfels
/// ([`order`](crate::passes::order)). Each piece lies together in space, and the pieces lie
/// everywhere in the scene, so that all shares have a like part of what is near and far, visible
/// and hidden. No bit of a picture depends on how surfels are shared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Share {
    /// Number of shares.
    of: u32,
    /// Number of this share, from 1.
    number: u32,
}

/// Pieces of a share.
pub const PIECES: u32 = 32;

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

    /// The places of this share among `count` surfels, in order. The shares cover all places
    /// without overlap.
    pub fn pieces(self, count: usize) -> impl Iterator<Item = Range<usize>> + Clone {
        let all = u128::from(self.of) * u128::from(PIECES);
        let end = move |piece: u128| (count as u128 * piece / all) as usize;
        (0..PIECES).map(move |turn| {
            let piece = u128::from(turn) * u128::from(self.of) + u128::from(self.number - 1);
            end(piece)..end(piece + 1)
        })
    }

    /// The number of surfels of this share among `count`.
    pub fn len(self, count: usize) -> usize {
        self.pieces(count).map(|piece| piece.len()).sum()
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
            assert!(shares.clone().all(|share| share.len(count).abs_diff(least) <= PIECES as usize + 1), "{of}");
            let mut pieces: Vec<_> = shares.flat_map(|share| share.pieces(count)).collect();
            pieces.sort_by_key(|piece| (piece.start, piece.end));
            let mut end = 0;
            for piece in pieces {
                assert!(piece.start == end && piece.end >= end);
                end = piece.end;
            }
            assert_eq!(end, count);
        }
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
