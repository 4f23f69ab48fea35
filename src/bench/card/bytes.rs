//! The least that the passes of a frame move, bytes.
//!
//! A pass reads what the passes before it left and writes what the next ones read; each byte of that counts once, as if what is
//! touched again came from a cache. So a pass moves more, by as much as caches miss, and where the data fit a cache it may be
//! faster than memory.
//!
//! With n surfels in b batches, d of them drawn, p pixels, c of them covered, S words of sums and W of the image a pixel:
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | project | 36 n | 64 n |
//! | the same where batches are culled | 36 d + 16 b | 64 d |
//! | visibility | 64 d + 4 p | |
//! | accumulate | 64 d + 4 c | 4 S c |
//! | resolve | 4 c + 4 S c | 4 W c |
//! | accumulate where tiles gather and resolve | 4 c | 4 W c |
//!
//! A surfel has 36 bytes ([`Surfel`]), or 48 where its centre has trailing digits, its splat 64 ([`Splat`]), a batch's ball 16.
//! Nearest depths, a word a pixel, are all read for what hides; their writing, by atomics, is left out, as is what was cleared
//! before a pass. Colours and half-axes that accumulate reads of splats that are not hidden are left out too: how many those are is
//! not known here.

use std::collections::BTreeMap;

use crate::gpu::layout::{BATCH, Splat};
use crate::scene::Surfel;

/// Bytes of a word.
const WORD: u64 = 4;

/// Bytes of a batch's bounding ball.
const BALL: u64 = 16;

/// Bytes of the trailing digits of a centre.
const LOW: u64 = 12;

/// What a frame's passes have to move, as numbers of records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moved {
    /// Surfels of the scene.
    pub surfels: u64,
    /// Splats that may touch a pixel.
    pub drawn: u64,
    /// Pixels of the image.
    pub pixels: u64,
    /// Pixels that show something.
    pub covered: u64,
    /// u32 words of a pixel's sums.
    pub sum_words: u64,
    /// u32 words of a pixel in the image.
    pub image_words: u64,
    /// Centres have trailing digits.
    pub doubled: bool,
    /// Batches are culled.
    pub culls: bool,
    /// Tiles sum all splats and resolve their pixels: no sum is stored.
    pub gathers: bool,
}

impl Moved {
    /// The least bytes of each pass, by its name.
    pub fn least(&self) -> BTreeMap<&'static str, u64> {
        let surfel = size_of::<Surfel>() as u64 + if self.doubled { LOW } else { 0 };
        let splat = size_of::<Splat>() as u64;
        let (depths, image) = (WORD * self.covered, WORD * self.image_words * self.covered);
        let sums = WORD * self.sum_words * self.covered;
        let project = match self.culls {
            true => (surfel + splat) * self.drawn + BALL * self.surfels.div_ceil(BATCH.into()),
            false => (surfel + splat) * self.surfels,
        };
        let mut least = BTreeMap::from([("project", project), ("visibility", splat * self.drawn + WORD * self.pixels)]);
        match self.gathers {
            true => drop(least.insert("accumulate", depths + image)),
            false => {
                least.insert("accumulate", splat * self.drawn + depths + sums);
                least.insert("resolve", depths + sums + image);
            }
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_are_those_of_the_table() {
        let moved = Moved {
            surfels: 1000,
            drawn: 900,
            pixels: 10_000,
            covered: 5000,
            sum_words: 16,
            image_words: 4,
            ..Moved::default()
        };
        let of = |moved: Moved| moved.least().into_iter().collect::<Vec<_>>();
        let (visibility, resolve) = (64 * 900 + 40_000, 5000 * (4 + 64 + 16));
        let scattered = 64 * 900 + 5000 * (4 + 64);
        let expected = |project, accumulate| {
            vec![("accumulate", accumulate), ("project", project), ("resolve", resolve), ("visibility", visibility)]
        };
        assert_eq!(of(moved), expected(100 * 1000, scattered));
        assert_eq!(of(Moved { doubled: true, ..moved }), expected(112 * 1000, scattered));
        assert_eq!(of(Moved { culls: true, ..moved }), expected(100 * 900 + 16 * 16, scattered));
        let gathered = [("accumulate", 5000 * (4 + 16)), ("project", 100_000), ("visibility", visibility)];
        assert_eq!(of(Moved { gathers: true, ..moved }), gathered);
    }
}
