//! Cuts images into bands of rows and scenes into pages of surfels, so that each piece fits a
//! buffer.

use super::{SceneNeeds, SurfelLayout, splat_words};
use crate::error::{Error, Result};
use crate::gpu::adapter::AdapterDescription;
use crate::gpu::layout::{BATCH, MOST_GROUPS, MOST_ROUNDS, OCCLUSION_TILE, TILE};
use crate::scene::Camera;

/// A band: the rows of the image that buffers hold at one time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Band {
    /// First row.
    pub first: u32,
    /// Number of rows.
    pub rows: u32,
    /// Number of pixels.
    pub pixels: u64,
    /// Number of tiles of [`OCCLUSION_TILE`] pixels squared that cover the band.
    pub tiles: u64,
}

impl Band {
    /// Creates the band of `rows` rows from `first` on, in an image of width `width`.
    pub fn of(width: u32, first: u32, rows: u32) -> Self {
        let [across, down] = [width, rows].map(|side| u64::from(side.div_ceil(OCCLUSION_TILE)));
        Self { first, rows, pixels: u64::from(rows) * u64::from(width), tiles: across * down }
    }
}

/// Cuts the image into bands whose rows are a multiple of `whole`. The largest buffer has `head`
/// u32 words, then `words` u32 words per pixel.
///
/// # Errors
/// [`Error::Limit`] if `whole` rows need more than one buffer.
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
    // One splat may cover the whole band, so a band is limited to what the invocations of one
    // workgroup can loop over: Mesa's llvmpipe ends loops after 65,535 rounds. No graphics card is
    // known to have such a limit.
    let untiring = if adapter.is_software() { MOST_ROUNDS * TILE * TILE } else { u32::MAX };
    let rows = rows.min(u64::from(untiring / camera.width)).min(camera.height.into()) as u32;
    Ok(strips(camera, (rows / whole * whole).max(whole)))
}

/// Cuts the image into bands of `rows` rows; the last has the remainder.
pub fn strips(camera: &Camera, rows: u32) -> Vec<Band> {
    let band = |first: u32| Band::of(camera.width, first, rows.min(camera.height - first));
    (0..camera.height).step_by(rows as usize).map(band).collect()
}

/// Returns the number of surfels per page: whole batches, unless one batch is too large. Each batch
/// is a row of a dispatch, and every adapter allows [`MOST_GROUPS`] rows. The splat's record or the
/// surfel's attributes, whichever is larger, limits the page.
pub fn page_surfels(adapter: &AdapterDescription, needs: &SceneNeeds) -> u64 {
    let splats = if needs.twice() { 2 } else { 1 };
    let words = (splats * splat_words(needs)).max(SurfelLayout::of(needs).words.into());
    let most = adapter.page_len(4 * words as usize);
    let whole = most / u64::from(BATCH) * u64::from(BATCH);
    if whole > 0 { whole.min(u64::from(MOST_GROUPS * BATCH)) } else { most.max(1) }
}
