//! Stage 2 of [`sorted`](super::sorted): where each pixel's list of fragments may end.
//!
//! For a far cloud thousands of fragments may lie at a pixel, more than a device sorts or a buffer
//! holds, though the nearest ones hide the others. So in a view whose lists turn out to be too
//! long, the visibility pass sums the fragments' optical depths, `-ln(1 - alpha)`, in
//! [`VEILS`](crate::plan::extra::VEILS) steps of depth per pixel: its veils. The list ends with the
//! first step up to which the sum H is at least `ln(1 / s) + MARGIN`, where s is the transmittance
//! below which compositing stops ([`Rules::least_shown`](super::sorted::Rules)).
//!
//! **No bit of the image changes.** Steps do not overlap, and counting and listing compute the same
//! depths, so the listed fragments are the front part of all fragments in depth order. H is never
//! too large: each term comes from a fragment that is surely listed, is rounded down, and is at
//! most that of an alpha of 0.999; a sum that wraps is smaller too. So the transmittance behind the
//! last listed fragment is at most `exp(-H) <= s exp(-MARGIN)`, but for two errors. If one kernel
//! rounds an alpha by 2e-6 of itself, a term changes by at most 3e-4 of itself, which is 0.006 for
//! H = 21. The product of n factors in f32 errs by `2 n u`, u = 2^-24, which is 0.012 for
//! n = 100,000. The sum of both errors is below MARGIN, so compositing stops within the list, where
//! it would stop in the complete list.
//!
//! On a software adapter a view with veils takes 1.1 to 1.2 times as long. A view that needs no
//! veils has none, unless an earlier view of the same image size needed them.

use super::sorted::Rules;
use crate::plan::Plan;
use crate::plan::pass::Pass;
use crate::plan::steps::{Kernel, Over, Run, Stage};

/// Units per optical depth of 1.
const UNITS: f64 = 1024.0;

/// The margin on the optical depth for rounding; see the module's proof.
const MARGIN: f64 = 0.02;

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "veils",
    files: |needs| if needs.surface.veils() { vec!["fragments_veils.wgsl"] } else { Vec::new() },
    kernels: |needs| if needs.surface.veils() { vec![END] } else { Vec::new() },
    constants: |making| {
        let rules = Rules::of(making.options);
        let enough = ((1.0 / rules.least_shown).ln() + MARGIN) * UNITS;
        // Two kernels may round a fragment's alpha to different sides of the limit. Slightly
        // fainter fragments are counted too, so that each listed fragment has a place.
        vec![
            ("LEAST_COUNTED", rules.least_alpha * (1.0 - 1e-4)),
            ("LEAST_HELD", rules.least_alpha * (1.0 + 1e-4)),
            ("ENOUGH_HELD", enough.ceil()),
        ]
    },
};

const END: Kernel = Kernel::new("end_lists");

/// The stage that finds where lists end, after fragments were counted.
pub fn steps(plan: &Plan, band: usize) -> Option<Stage> {
    let run = Run { kernel: END, over: Over::Pixels };
    plan.needs.surface.veils().then(|| Stage::new("visibility", band, vec![run]))
}
