//! Stages 2 to 4 where the rasteriser shows [`Composite::Layers`]: depth peeling (Everitt 2001), which the lists of
//! [`fragments`](super::fragments) are compared with. The visibility and the attribute pass are drawn once a layer, each time of what no
//! layer before has, and what they blend is composited behind those.
//!
//! A layer is an epsilon's window behind its nearest fragment ([`Parting::Window`](super::layers::Parting::Window)): where a run of fragments
//! ends the rasteriser cannot know before it has drawn all of them.

use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Run, Stage, Step};
use crate::plan::{Plan, RenderOptions};
use crate::scene::Composite;

/// More layers are not peeled.
pub const MOST_LAYERS: u32 = 64;

/// Words of a pixel (`peeled.wgsl`).
pub const PEELED_WORDS: u32 = 8;

/// The layers that the rasteriser peels for `options`, if it peels at all.
pub fn layers(options: &RenderOptions) -> Option<u32> {
    match options.composite {
        Composite::Layers(layers) if options.raster.is_some() => Some(layers),
        _ => None,
    }
}

/// The kernels and files.
pub const PASS: Pass = Pass {
    name: "peel",
    files: |needs| if needs.peels.is_some() { vec!["peeled.wgsl"] } else { Vec::new() },
    kernels: |needs| if needs.peels.is_some() { vec![PEEL] } else { Vec::new() },
    constants: |_| Vec::new(),
};

const PEEL: Kernel = Kernel::new("peel");

/// The steps of all layers of `plan`, in place of the one that draws the nearest surface.
pub fn steps(plan: &Plan, layers: u32) -> Vec<Step> {
    let words = u64::from(PEELED_WORDS) * plan.bands[0].pixels;
    let mut steps = vec![Step::Stage(Stage::new("visibility", 0, vec![]).after(vec![Clear::of("peeled", 0, words)]))];
    for _ in 0..layers {
        steps.push(Step::Draw);
        steps.push(Step::Stage(Stage::new("resolve", 0, vec![Run { kernel: PEEL, over: Over::Pixels }])));
    }
    steps
}
