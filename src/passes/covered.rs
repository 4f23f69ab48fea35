//! Stage 4, its start: which tiles of the image have anything. An image has pixels that no splat covers, and to resolve them
//! takes as long as to resolve others; so those tiles stay as the image was cleared, unless its background or its depth map
//! differ from 0 there.

use super::Rows;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::kernel::{Bound, Grid, Program, grid};
use crate::gpu::layout::{COVERED_GRID, COVERED_GRID_OF_EIGHTS, COVERED_LIST};
use crate::plan::RenderOptions;

/// Whether a pixel differs from 0 where nothing is.
pub fn lists_empty(options: &RenderOptions) -> bool {
    options.maps.depth || options.background.iter().any(|value| value.to_bits() != 0)
}

/// The list of the covered tiles, a part of a buffer.
#[derive(Clone, Copy)]
pub struct Covered<'a> {
    words: &'a Buffer<u32>,
    first: u64,
}

impl<'a> Covered<'a> {
    /// The list that starts at the word `first` of `words`.
    pub fn new(words: &'a Buffer<u32>, first: u64) -> Self {
        Self { words, first }
    }

    /// Words that the list of `rows` takes at most.
    pub fn room(rows: &Rows) -> u64 {
        u64::from(COVERED_LIST) + rows.tiles
    }

    /// A workgroup for each covered tile.
    pub(crate) fn each(&self) -> Grid<'a> {
        Grid::In(&self.words.raw, (self.first + u64::from(COVERED_GRID)) * 4)
    }

    /// A workgroup for eight covered tiles.
    pub(crate) fn eights(&self) -> Grid<'a> {
        Grid::In(&self.words.raw, (self.first + u64::from(COVERED_GRID_OF_EIGHTS)) * 4)
    }

    /// Clears the list.
    pub(crate) fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.words.raw, self.first * 4, Some(u64::from(COVERED_LIST) * 4));
    }

    /// The buffer that it is in.
    pub(crate) fn bound(&self) -> wgpu::BindingResource<'a> {
        self.words.bound()
    }

    /// Records the list of `rows`; `bound` binds their sums, unless their nearest depths tell.
    pub(crate) fn record(
        &self,
        (gpu, program): (&Gpu, &Program),
        pass: &mut wgpu::ComputePass<'_>,
        rows: &Rows,
        bound: &[(&str, wgpu::BindingResource<'_>)],
    ) -> Result<()> {
        let bound: Bound<'_> = bound.iter().cloned().chain([("nearest", self.bound())]).collect();
        program.dispatch(gpu, pass, "list_covered", &bound, Grid::Of(grid(gpu, rows.tiles)?))?;
        program.dispatch(gpu, pass, "arrange_covered", &bound, Grid::Of((1, 1)))
    }
}
