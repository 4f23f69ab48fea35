//! Blocks of pixels, each of which one process owns: it reduces their values and resolves them.
//!
//! A block is a run of pixels in a row of samples, at most 64 of these, so that a word tells which
//! of them have values. The blocks of an image are dealt to the processes in turn, from row to row
//! one process later, so that each owns a like number anywhere in the image. All samples of a pixel
//! have one owner, in every render of the image.

use std::ops::Range;

use crate::render::exchange::{Rows, Runs, push};
use crate::scene::Samples;

/// Most samples of a block.
const MOST: u32 = 64;

/// The blocks of a row of an image, and their owners.
#[derive(Clone, Copy)]
pub struct Blocks {
    /// Columns of a row, samples.
    width: usize,
    /// Samples of a block in a row.
    block: usize,
    /// Rows of samples in a pixel.
    down: usize,
    /// Number of processes.
    owners: usize,
}

impl Blocks {
    /// The pixels of a block for an image whose renders have these `samples`.
    pub fn pixels(samples: &[Samples]) -> u32 {
        (MOST / samples.iter().map(|samples| samples.across).max().unwrap_or(1)).max(1)
    }

    /// The blocks of a render that is `width` samples wide and has these `samples` in each pixel. A
    /// block has [`pixels`](Self::pixels), and `owners` processes own some.
    pub fn new(width: u32, samples: Samples, pixels: u32, owners: usize) -> Self {
        let block = (pixels * samples.across).max(1) as usize;
        Self { width: width as usize, block, down: samples.down.max(1) as usize, owners }
    }

    /// Number of blocks in a row.
    fn across(self) -> usize {
        self.width.div_ceil(self.block)
    }

    /// The blocks of `rows`, with the number of each and its owner.
    pub fn of(self, rows: &Rows) -> impl Iterator<Item = (u32, usize)> {
        let (across, first) = (self.across(), rows.first as usize);
        (0..rows.rows as usize * across).map(move |block| {
            let pixel_row = (first + block / across) / self.down;
            (block as u32, (pixel_row + block % across) % self.owners)
        })
    }

    /// Whether each block of `rows` has a sample of `runs`.
    pub fn used(self, rows: &Rows, runs: &Runs) -> Vec<bool> {
        let mut used = vec![false; rows.rows as usize * self.across()];
        for run in runs {
            let mut at = run.start;
            while at < run.end {
                let block = at / self.width * self.across() + at % self.width / self.block;
                used[block] = true;
                at = self.samples(block as u32).end;
            }
        }
        used
    }

    /// The samples of the blocks that are used.
    pub fn runs(self, used: &[bool]) -> Runs {
        let mut runs = Runs::new();
        let blocks = used.iter().enumerate().filter(|(_, used)| **used);
        blocks.for_each(|(block, _)| push(&mut runs, self.samples(block as u32)));
        runs
    }

    /// The samples of a block, counted from the first of its rows.
    pub fn samples(self, block: u32) -> Range<usize> {
        let (row, column) = (block as usize / self.across(), block as usize % self.across());
        let start = row * self.width + column * self.block;
        start..start + self.block.min(self.width - column * self.block)
    }
}

/// The bits of a block's samples for which `has` says so.
pub fn mask(samples: Range<usize>, has: impl Fn(usize) -> bool) -> u64 {
    samples.enumerate().fold(0, |mask, (bit, sample)| mask | u64::from(has(sample)) << bit)
}

/// The samples of a block whose bits are set.
pub fn marked(samples: Range<usize>, mut mask: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = mask.trailing_zeros() as usize;
        // Clears the lowest bit.
        mask &= mask.wrapping_sub(1);
        (bit < samples.len()).then_some(samples.start + bit)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every sample lies in one block, and a pixel has one owner in all renders.
    #[test]
    fn pixels_have_one_owner() {
        let grid = |across, down| Samples { across, down };
        for (width, samples, owners) in
            [(1, grid(1, 1), 3), (64, grid(1, 1), 1), (65, grid(2, 2), 7), (250, grid(4, 2), 4), (31, grid(16, 16), 3)]
        {
            let (height, renders) = (3, [samples, Samples::ONE]);
            let pixels = Blocks::pixels(&renders);
            let mut owner = vec![None; width as usize * height as usize];
            for samples in renders {
                let across = width * samples.across;
                let blocks = Blocks::new(across, samples, pixels, owners);
                // The second of two bands.
                let first = 2 * samples.down;
                let rows = Rows { render: 0, first, rows: height * samples.down, width: across };
                let mut seen = vec![false; rows.samples().len()];
                for (block, own) in blocks.of(&rows) {
                    assert!(blocks.samples(block).len() <= MOST as usize);
                    for sample in blocks.samples(block) {
                        assert!(!std::mem::replace(&mut seen[sample], true));
                        let (row, column) = (sample / across as usize, sample % across as usize);
                        let pixel = row / samples.down as usize * width as usize + column / samples.across as usize;
                        assert_eq!(*owner[pixel].get_or_insert(own), own);
                    }
                }
                assert!(seen.iter().all(|seen| *seen));
                // Runs grow to the blocks that they touch.
                let run = 1..rows.samples().len().div_ceil(2);
                let grown = blocks.runs(&blocks.used(&rows, &vec![run.clone()]));
                let touched = |block: u32| {
                    let samples = blocks.samples(block);
                    samples.start < run.end && run.start < samples.end && !run.is_empty()
                };
                let expected = blocks.of(&rows).filter(|(block, _)| touched(*block));
                let expected: Vec<_> = expected.flat_map(|(block, _)| blocks.samples(block)).collect();
                assert_eq!(grown.into_iter().flatten().collect::<Vec<_>>(), expected);
            }
            let owned = |of: usize| owner.iter().filter(|own| **own == Some(of)).count();
            let most = (0..owners).map(owned).max().unwrap_or(0);
            assert!(most <= owner.len() / owners + 2 * pixels as usize, "{most}");
        }
    }

    #[test]
    fn masks_tell_samples() {
        let set = |sample: usize| sample % 3 == 1;
        let mask = mask(100..164, set);
        assert_eq!(marked(100..164, mask).collect::<Vec<_>>(), (100..164).filter(|k| set(*k)).collect::<Vec<_>>());
    }
}
