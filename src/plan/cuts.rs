//! Where images and scenes are cut, so that each piece fits a buffer: bands of rows, pages of surfels.

use super::{SceneNeeds, SurfelLayout, splat_words};
use crate::error::{Error, Result};
use crate::gpu::adapter::AdapterDescription;
use crate::gpu::layout::{BATCH, MOST_GROUPS, MOST_ROUNDS, OCCLUSION_TILE, TILE};
use crate::scene::Camera;

/// Rows of the image that buffers hold at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Band {
    /// First row.
    pub first: u32,
    /// How many.
    pub rows: u32,
    /// Pixels in them.
    pub pixels: u64,
    /// Tiles of [`OCCLUSION_TILE`] pixels squared that cover them.
    pub tiles: u64,
}

impl Band {
    /// Of `rows` rows from `first` on of an image of a width.
    pub fn of(width: u32, first: u32, rows: u32) -> Self {
        let [across, down] = [width, rows].map(|side| u64::from(side.div_ceil(OCCLUSION_TILE)));
        Self { first, rows, pixels: u64::from(rows) * u64::from(width), tiles: across * down }
    }
}

/// The image in bands of `whole` rows or a multiple, for `words` u32 words a pixel in the largest buffer, after `head` others.
///
/// # Errors
/// [`Error::Limit`] if one row is too long.
pub fn bands(adapter: &AdapterDescription, camera: &Camera, whole: u32, words: u32, head: u64) -> Result<Vec<Band>> {
    let row_bytes = u64::from(camera.width) * u64::from(words) * 4;
    let rows = adapter.buffer_limit().saturating_sub(4 * head) / row_bytes;
    if rows < whole.into() {
        return Err(Error::Limit {
            adapter: adapter.name.clone(),
            limit: "max_storage_buffer_binding_size",
            available: adapter.buffer_limit(),
            needed: row_bytes * u64::from(whole),
            what: format!("for one row of {} pixels; choose a narrower image", camera.width),
        });
    }
    // A workgroup that draws a splat over the whole band must not tire the invocations of a processor: Mesa's llvmpipe ends loops
    // after 65,535 rounds; of cards none is known to.
    let untiring = if adapter.is_software() { MOST_ROUNDS * TILE * TILE } else { u32::MAX };
    let rows = rows.min(u64::from(untiring / camera.width)).min(camera.height.into()) as u32;
    Ok(strips(camera, (rows / whole * whole).max(whole)))
}

/// The image in bands of `rows` each, the last of what is left.
pub fn strips(camera: &Camera, rows: u32) -> Vec<Band> {
    let band = |first: u32| Band::of(camera.width, first, rows.min(camera.height - first));
    (0..camera.height).step_by(rows as usize).map(band).collect()
}

/// Surfels of a page: whole batches, unless one is too large; each batch is a row of a dispatch, of which every adapter grants so
/// many. The splat's record is the largest of what is paged alike, or a surfel's attributes are.
pub fn page_surfels(adapter: &AdapterDescription, needs: &SceneNeeds) -> u64 {
    let words = splat_words(needs).max(SurfelLayout::of(needs).words.into());
    let most = adapter.page_len(4 * words as usize);
    let whole = most / u64::from(BATCH) * u64::from(BATCH);
    if whole > 0 { whole.min(u64::from(MOST_GROUPS * BATCH)) } else { most.max(1) }
}
