//! Stage 4, its start: which tiles of the image have anything. An image has pixels that no splat covers, and to resolve them
//! takes as long as to resolve others; so those tiles stay as the image was cleared, unless its background or its depth map
//! differ from 0 there.

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
        // Of peeled layers the last one may be empty.
        let needs = making.needs;
        let list_empty = making.options.shows_where_nothing_is() || needs.peels.is_some();
        vec![
            ("LIST_EMPTY", u32::from(list_empty).into()),
            ("LIST_APART", u32::from(needs.separate).into()),
            ("TILE_ROWS", super::tiles::rows(needs).into()),
        ]
    },
};

const LIST: Kernel = Kernel::new("list_covered");
const ARRANGE: Kernel = Kernel::of("arrange_covered", [1; 3]);

/// Words that the list of a band takes at most.
pub fn words(band: &Band) -> u64 {
    u64::from(COVERED_LIST) + band.tiles
}

/// The word of the buffer of nearest depths at which the list of a band starts: the rasteriser keeps no depths in it.
pub fn start(plan: &Plan, band: usize) -> u64 {
    let band = &plan.bands[band];
    if plan.needs.raster.is_some() { 0 } else { band.pixels + band.tiles }
}

/// The head of the list, cleared: nothing is in it.
pub fn restart(plan: &Plan, band: usize) -> Clear {
    Clear::of("nearest", start(plan, band), COVERED_LIST.into())
}

/// What is cleared before the list is made: its head, and the image, of which covered tiles alone are written.
pub fn clears(plan: &Plan, band: usize) -> Vec<Clear> {
    let mut clears = vec![restart(plan, band)];
    if !plan.lists_empty || super::asks_for_order(&plan.needs) {
        let words = plan.image_pixels(band) * u64::from(plan.pixel.image_words);
        clears.push(Clear::of("image", 0, words));
    }
    clears
}

/// What lists the tiles in which a nearest depth is.
pub const LISTS: Run = Run { kernel: LIST, over: Over::Occlusion };

/// What makes the list, by what `lists` its tiles.
pub fn runs(lists: Run) -> [Run; 2] {
    [lists, Run { kernel: ARRANGE, over: Over::Once }]
}
