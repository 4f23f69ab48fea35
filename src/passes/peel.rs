//! Stages 2 to 4 of [`Composite::Layers`](crate::scene::Composite::Layers) by the rasteriser: depth
//! peeling (Everitt 2001), the baseline for the lists of [`fragments`](super::fragments).
//!
//! `render/sequence.rs` takes these steps for `Rasterised::Layers`. The visibility and the
//! attribute pass are drawn once per layer, each time without the fragments of the layers before,
//! and the result is composited behind those layers.
//!
//! A layer ends one epsilon behind its nearest fragment
//! ([`Parting::Window`](super::layers::Parting::Window)) and not at the first gap between
//! fragments: the rasteriser cannot find that gap before it has drawn all fragments.

use crate::plan::Plan;
use crate::plan::extra;
use crate::plan::pass::Pass;
use crate::plan::steps::{Kernel, Over, Run, Stage, Step};

/// The pass's kernels and files.
pub const PASS: Pass = Pass {
    name: "peel",
    files: |needs| if needs.surface.peels().is_some() { vec!["peeled.wgsl"] } else { Vec::new() },
    kernels: |needs| if needs.surface.peels().is_some() { vec![PEEL] } else { Vec::new() },
    constants: |_| Vec::new(),
};

const PEEL: Kernel = Kernel::new("peel");

/// The steps of all layers of `plan`, in place of the one step that draws the nearest surface.
pub fn steps(plan: &Plan, layers: u32) -> Vec<Step> {
    let mut steps = vec![Step::Stage(
        Stage::new("visibility", 0, vec![]).after(extra::clear("peeled", plan, 0).into_iter().collect()),
    )];
    for _ in 0..layers {
        steps.push(Step::Draw);
        steps.push(Step::Stage(Stage::new("resolve", 0, vec![Run { kernel: PEEL, over: Over::Pixels }])));
    }
    steps
}
