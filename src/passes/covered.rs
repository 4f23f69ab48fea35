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
    kernels: |_| vec![LIST, ARRANGE],
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
const ARRANGE: Kernel = Kernel::of("arrange_covered", [1; 3]);

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

/// The clears before the list is made: the list's header, and the image, because only covered tiles
/// are written later.
pub fn clears(plan: &Plan, band: usize) -> Vec<Clear> {
    let mut clears = vec![restart(plan, band)];
    if !plan.lists_empty || super::asks_for_order(&plan.needs) {
        let words = plan.image_pixels(band) * u64::from(plan.pixel.image_words);
        clears.push(Clear::of("image", 0, words));
    }
    clears
}

/// The dispatch that lists the tiles with a nearest depth.
pub const LISTS: Run = Run { kernel: LIST, over: Over::Occlusion };

/// The dispatches that make the list: `lists`, which lists the tiles, and one that writes the
/// numbers of workgroups of the dispatches over the list.
pub fn runs(lists: Run) -> [Run; 2] {
    [lists, Run { kernel: ARRANGE, over: Over::Once }]
}
