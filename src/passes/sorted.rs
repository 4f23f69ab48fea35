//! Stage 4 of [`Composite::Sorted`](crate::scene::Composite::Sorted): every fragment of a pixel by itself, from front to back, lit at its own normal. What it shows
//! is its surfel's alpha times its weight.

use super::Strip;
use super::fragments::{self, Fragment};
use super::layers::Shown;
use super::resolve::shaded;
use crate::frame::Frame;
use crate::plan::Lists;
use crate::plan::pass::Pass;

/// The twin: the image of `strip`.
pub fn reference(strip: &Strip<'_>, frame: &mut Frame) {
    let Strip { scene, camera, options, first_row, .. } = *strip;
    // At one place the depths of two fragments are the same numbers, and the order of their surfels decides.
    let place = |f: &Fragment| {
        let surfel = f.surfel as usize;
        (scene.surfels[surfel], scene.low.get(surfel), scene.caps.get(surfel))
    };
    for (pixel, list) in fragments::reference(strip).into_iter().enumerate() {
        let at = (pixel as u32 % camera.width, pixel as u32 / camera.width + first_row);
        let (mut shown, mut decision, mut before) = (Shown::NOTHING, list.decision, None::<&Fragment>);
        for f in &list.fragments {
            if !shown.lets_through() {
                break;
            }
            // Where two depths are one but for rounding, either may come first.
            if let Some(before) = before.filter(|before| place(before) != place(f)) {
                decision = decision.min(1.0 - before.depth / f.depth);
            }
            before = Some(f);
            let normal = if f.back { -f.normal } else { f.normal };
            let [r, g, b, alpha] = shaded(f.color, normal, camera, options, at);
            shown.add([r, g, b, f.weight * alpha]);
            decision = decision.min(shown.decision());
        }
        shown.write(options, decision, frame, pixel);
    }
}

/// The files.
pub const PASS: Pass = Pass {
    name: "sorted",
    files: |needs| if needs.lists == Some(Lists::Sorted) { vec!["sorted.wgsl"] } else { Vec::new() },
    kernels: |_| Vec::new(),
    constants: |_| Vec::new(),
};
