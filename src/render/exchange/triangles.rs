//! The exchange of the shaded triangles of each pixel.

use super::Run;
use crate::error::Result;
use crate::plan::Plan;
use crate::plan::extra::TRIANGLE_PIXEL_WORDS;

impl Run<'_> {
    /// The shaded triangles of each pixel of `band`, with 0 in tiles where none shows.
    pub(super) fn drawn_triangles(&self, band: usize) -> Result<Vec<u32>> {
        let of = &self.plan.bands[band];
        let pixels = of.pixels as usize * TRIANGLE_PIXEL_WORDS as usize;
        let mut words = self.words("triangle_pixels", triangle_words(self.plan, band))?;
        let tiles = words.split_off(pixels.min(words.len()));
        let width = self.plan.width as usize;
        for (pixel, record) in words.chunks_exact_mut(TRIANGLE_PIXEL_WORDS as usize).enumerate() {
            let tile = tile_of(pixel, width);
            // Pixels of tiles without triangles hold values of earlier bands.
            if tiles.get(4 * tile).is_none_or(|shows| *shows == 0) {
                record.fill(0);
            }
        }
        Ok(words)
    }

    /// Writes the shaded triangles of `band`, and which tiles have any.
    pub(super) fn put_triangles(&self, band: usize, given: &[u32]) -> Result<()> {
        let of = &self.plan.bands[band];
        let mut words = given.to_vec();
        words.resize(triangle_words(self.plan, band) as usize, 0);
        let pixels = of.pixels as usize * TRIANGLE_PIXEL_WORDS as usize;
        if given.len() != pixels {
            return Err(self.gpu.error("triangles of pixels were exchanged that belong to another frame"));
        }
        for (pixel, record) in given.chunks_exact(TRIANGLE_PIXEL_WORDS as usize).enumerate() {
            if record.iter().any(|word| *word != 0) {
                let tile = pixels + 4 * tile_of(pixel, self.plan.width as usize);
                words[tile..tile + 4].fill(1f32.to_bits());
            }
        }
        self.put("triangle_pixels", &words, words.len() as u64)
    }

    /// The first words of a buffer; none if the frame does not have it.
    fn words(&self, name: &str, len: u64) -> Result<Vec<u32>> {
        self.store.buffer(name).map_or_else(|| Ok(Vec::new()), |buffer| buffer.read(self.gpu, len))
    }

    /// Overwrites the first `len` words of a buffer.
    fn put(&self, name: &str, words: &[u32], len: u64) -> Result<()> {
        let Some(buffer) = self.store.buffer(name) else { return Ok(()) };
        if words.len() as u64 != len {
            return Err(self.gpu.error("values of pixels were exchanged that belong to another frame"));
        }
        buffer.write(self.gpu, words.len(), |range| words[range].into(), &())
    }
}

/// The side of the tiles that know whether triangles show in them, pixels
/// (`wgsl/triangles/triangles_tiles.wgsl`).
const TILE: usize = crate::gpu::layout::OCCLUSION_TILE as usize;

/// The tile of a band's pixel.
fn tile_of(pixel: usize, width: usize) -> usize {
    pixel / width / TILE * width.div_ceil(TILE) + pixel % width / TILE
}

/// Words of a band's shaded triangles, its tiles included.
fn triangle_words(plan: &Plan, band: usize) -> u64 {
    crate::passes::triangles::pixel_words(&plan.bands[band])
}
