//! The least number of bytes that the passes of a frame move.
//!
//! Every byte that a pass reads from earlier passes or writes for later ones counts once, as if
//! repeated accesses hit a cache. A pass moves more where caches miss, and may be faster than
//! memory where its data fit in a cache.
//!
//! The table gives bytes for n surfels in b batches. d surfels are drawn, and c of the p pixels are
//! covered. A pixel has S words of sums and W words in the image.
//!
//! | pass | reads | writes |
//! |---|---|---|
//! | project | 36 n | 64 n |
//! | project where batches are culled | 36 d + 16 b | 64 d |
//! | visibility | 64 d + 4 p | |
//! | accumulate | 64 d + 4 c | 4 S c |
//! | resolve | 4 c + 4 S c | 4 W c |
//! | accumulate where tiles gather and resolve | 4 c | 4 W c |
//!
//! A surfel takes 36 bytes ([`Surfel`]), or 48 if centres have low-order parts. A splat takes 64
//! bytes ([`Splat`]), and the bounding sphere of a batch 16. Visibility reads all nearest depths,
//! one word per pixel, to find hidden splats. Three things are left out: the atomic writes of
//! depths, the clears before a pass, and the colours and half-axes that accumulate reads for
//! visible splats. The number of visible splats is not known here.

use std::collections::BTreeMap;

use crate::gpu::layout::{BATCH, Splat};
use crate::scene::Surfel;

/// Size of a word, bytes.
const WORD: u64 = 4;

/// Size of a batch's bounding sphere, bytes.
const BALL: u64 = 16;

/// Size of the low-order part of a centre, bytes.
const LOW: u64 = 12;

/// The numbers of records that the passes of a frame read and write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Moved {
    /// Number of surfels in the scene.
    pub surfels: u64,
    /// Number of splats that may touch a pixel.
    pub drawn: u64,
    /// Number of pixels in the image.
    pub pixels: u64,
    /// Number of pixels that are not background.
    pub covered: u64,
    /// Size of a pixel's sums, u32 words.
    pub sum_words: u64,
    /// Size of a pixel in the image, u32 words.
    pub image_words: u64,
    /// Whether centres have low-order parts, which double their precision.
    pub doubled: bool,
    /// Whether batches are culled.
    pub culls: bool,
    /// Whether tiles sum all splats and resolve their pixels, so that no sum is stored.
    pub gathers: bool,
}

impl Moved {
    /// Returns the least bytes that each pass moves, by its name.
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
