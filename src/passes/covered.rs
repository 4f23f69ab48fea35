//! Stage 4, its start: the list of image tiles that are not empty.
//!
//! Resolving a pixel that no splat covers takes as long as resolving any other. Tiles without a
//! fragment are therefore skipped and keep the zeros to which the image is cleared, unless their
//! background or their depth map must differ from 0.

use crate::gpu::layout::COVERED_LIST;
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Run};
use crate::plan::{Band, Plan};

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "covered",
    files: |_| vec!["covered.wgsl"],
    kernels: |needs| needs.surface.raster().map_or_else(Vec::new, |_| vec![LIST]),
    constants: |making| {
        // With depth peeling the last layer may be empty, so its nearest depths do not show which
        // tiles have earlier layers.
        let needs = making.needs;
        let list_empty = making.options.shows_where_nothing_is() || needs.surface.peels().is_some();
        let [width, rows] = super::tiles::size(needs);
        vec![
            ("LIST_EMPTY", u32::from(list_empty).into()),
            ("LIST_APART", u32::from(needs.surface.separate()).into()),
            ("TILE_WIDTH", width.into()),
            ("TILE_ROWS", rows.into()),
        ]
    },
};

const LIST: Kernel = Kernel::new("list_covered");

/// The most words that a band's list can take.
pub fn words(band: &Band) -> u64 {
    u64::from(COVERED_LIST) + band.tiles
}

/// The word of the buffer `nearest` at which a band's list starts: 0 with the rasteriser, which
/// stores no depths in that buffer.
pub fn start(plan: &Plan, band: usize) -> u64 {
    let band = &plan.bands[band];
    if plan.needs.surface.raster().is_some() { 0 } else { band.pixels + band.tiles }
}

/// The clear of the list's header, which empties the list.
pub fn restart(plan: &Plan, band: usize) -> Clear {
    Clear::of("nearest", start(plan, band), COVERED_LIST.into())
}

/// The clear of the image before covered tiles are resolved, because only they are written.
pub fn clear(plan: &Plan, band: usize) -> Option<Clear> {
    let words = plan.image_pixels(band) * u64::from(plan.pixel.image_words);
    (!plan.lists_empty || super::asks_for_order(&plan.needs)).then(|| Clear::of("image", 0, words))
}

/// The dispatch that lists the tiles that the rasteriser covered. Without the rasteriser, the
/// kernel that finds the farthest of the nearest depths ([`visibility`](super::visibility)) lists
/// the tiles.
pub const LISTS: Run = Run { kernel: LIST, over: Over::Occlusion };
