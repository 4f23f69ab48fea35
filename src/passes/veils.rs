//! Stage 2 of what is [`sorted`](super::sorted): where each pixel's list of fragments may end.
//!
//! Of a far cloud thousands of fragments may lie at a pixel, more than a device sorts or a buffer holds, though the nearest ones hide the
//! others. So in a view in which lists turn out to be too long, the visibility pass adds up, in [`VEILS`] steps of depth, what the
//! fragments hold back, `-ln(1 - alpha)`, and the list ends with the first step up to which the sum H is at least
//! `ln(1 / s) + MARGIN`, s being the transmittance below which nothing more is composited
//! ([`Rules::least_shown`](super::sorted::Rules)).
//!
//! **No bit of the image changes.** What is listed is a front part of all fragments in the order of depths, as steps do not overlap: depths
//! are the same numbers in both kernels, as everywhere. Each term is of a fragment that is surely listed, is rounded down, and ends at that of
//! an alpha of 0.999; a sum that wraps is smaller too. So what is let through behind the last one is at most `exp(-H) <= s exp(-MARGIN)`, but
//! for two errors: an alpha that one kernel rounds by 2e-6 of itself changes its term by no more than 3e-4 of that, which is 0.006 of an H of
//! 21, and the product of n factors in f32 errs by `2 n u`, u = 2^-24, which is 0.012 of n = 100,000. Both stay below MARGIN, so compositing
//! stops within the list as it would in the whole one.
//!
//! Views that need no veils have none, unless one of the same size before them did: on a software adapter they take 1.1 to 1.2 times as long.

use super::sorted::Rules;
use crate::plan::Plan;
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Run, Stage};

/// Steps of depth.
pub const VEILS: u32 = 16;

/// Words of a pixel.
pub const VEIL_WORDS: u32 = 2 * VEILS;

/// Units of an optical depth of 1.
const UNITS: f64 = 1024.0;

/// See above.
const MARGIN: f64 = 0.02;

/// The kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "veils",
    files: |needs| if needs.veils { vec!["fragments_veils.wgsl"] } else { Vec::new() },
    kernels: |needs| if needs.veils { vec![END] } else { Vec::new() },
    constants: |making| {
        let rules = Rules::of(making.options);
        let enough = ((1.0 / rules.least_shown).ln() + MARGIN) * UNITS;
        // A hair below what is listed: of a fragment that two kernels round to either side none is without a place.
        vec![
            ("LEAST_COUNTED", rules.least_alpha * (1.0 - 1e-4)),
            ("LEAST_HELD", rules.least_alpha * (1.0 + 1e-4)),
            ("ENOUGH_HELD", enough.ceil()),
        ]
    },
};

const END: Kernel = Kernel::new("end_lists");

/// What is cleared before fragments are counted.
pub fn clears(plan: &Plan, band: usize) -> Option<Clear> {
    let words = u64::from(VEIL_WORDS) * plan.bands[band].pixels;
    plan.needs.veils.then(|| Clear::of("veils", 0, words))
}

/// Where lists end, after fragments were counted.
pub fn steps(plan: &Plan, band: usize) -> Option<Stage> {
    let run = Run { kernel: END, over: Over::Pixels };
    plan.needs.veils.then(|| Stage::new("visibility", band, vec![run]))
}
