//! Stage 4 of [`Composite::Sorted`] and [`Composite::Gaussians`]: composites every fragment of a
//! pixel by itself, from front to back, lit at its own normal.
//!
//! A fragment's alpha is its surfel's alpha times its weight, limited by [`Rules`].

use super::Strip;
use super::fragments::{self, Fragment};
use super::join::Beside;
use super::layers::Shown;
use super::resolve::shaded;
use crate::frame::Frame;
use crate::plan::pass::Pass;
use crate::plan::{Lists, Settings};
use crate::scene::composite::LEAST_TRANSMITTANCE;
use crate::scene::{Composite, gaussian};

/// The rules by which a pixel's fragments are composited.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// Fragments of smaller alpha are not listed.
    pub least_alpha: f64,
    /// Greater alphas are clamped to this one.
    pub most_alpha: f64,
    /// The smallest transmittance at which compositing goes on.
    pub least_shown: f64,
    /// Whether the fragment that would bring the transmittance below `least_shown` is left out too,
    /// and not only the fragments behind it.
    pub leaves_last: bool,
}

impl Rules {
    /// The rules for `options`.
    pub fn of(options: &Settings) -> Self {
        match options.composite {
            Composite::Gaussians => Self {
                least_alpha: gaussian::LEAST_ALPHA,
                most_alpha: gaussian::MOST_ALPHA,
                least_shown: gaussian::LEAST_SHOWN,
                leaves_last: true,
            },
            _ => Self { least_alpha: 0.0, most_alpha: 1.0, least_shown: LEAST_TRANSMITTANCE, leaves_last: false },
        }
    }
}

/// The f64 twin: the image of `strip`, with each pixel's triangle among its fragments.
pub fn reference(strip: &Strip<'_>, beside: &Beside<'_>, frame: &mut Frame) {
    let Strip { scene, camera, options, first_row, .. } = *strip;
    let rules = Rules::of(options);
    // Fragments of two surfels with the same geometry have exactly the same depth, so the order of
    // the surfels decides which fragment comes first.
    let place = |f: &Fragment| {
        let surfel = f.surfel as usize;
        (scene.surfels[surfel], scene.low.get(surfel), scene.caps.get(surfel), scene.thirds.get(surfel))
    };
    for (pixel, list) in fragments::reference(strip).into_iter().enumerate() {
        let at = (pixel as u32 % camera.width, pixel as u32 / camera.width + first_row);
        let (mut shown, mut decision, mut before) = (Shown::NOTHING, list.decision, None::<&Fragment>);
        let mut sensitivity = 1.0;
        let mut triangle = beside.triangle(pixel);
        for f in &list.fragments {
            if let Some(in_front) = triangle {
                decision = decision.min(in_front.decision).min((f.depth / in_front.depth - 1.0).abs());
            }
            if let Some(in_front) = triangle.take_if(|triangle| triangle.depth <= f.depth) {
                shown = shown.with(in_front.color, in_front.depth);
                if !shown.lets_through(rules.least_shown) {
                    break;
                }
            }
            let normal = if f.back { -f.normal } else { f.normal };
            let [r, g, b, alpha] = shaded(f.color, normal, camera, options, at);
            // Where a kernel falls steeply, its weight errs by more than the position in the disk
            // does.
            let steepness = 1.0 - f.weight.ln();
            let alpha = f.weight * alpha;
            if rules.least_alpha > 0.0 {
                decision = decision.min((alpha / rules.least_alpha - 1.0).abs() / steepness);
            }
            if alpha < rules.least_alpha {
                continue;
            }
            let alpha = alpha.min(rules.most_alpha);
            // If two depths are equal but for rounding, either fragment may come first.
            if let Some(before) = before.filter(|before| place(before) != place(f)) {
                decision = decision.min(1.0 - before.depth / f.depth);
            }
            before = Some(f);
            let next = shown.with([r, g, b, alpha], f.depth);
            // Behind an alpha near 1 the transmittance also errs by more. Without `leaves_last`
            // that does not matter, because fragments behind would hardly show.
            if rules.leaves_last {
                sensitivity += alpha / (1.0 - alpha) * steepness;
            }
            decision = decision.min(next.decision(rules.least_shown) / sensitivity);
            let shows_more = next.lets_through(rules.least_shown);
            if shows_more || !rules.leaves_last {
                shown = next;
            }
            if !shows_more {
                break;
            }
        }
        if let Some(behind) = triangle.filter(|_| shown.lets_through(rules.least_shown)) {
            decision = decision.min(behind.decision);
            shown = shown.with(behind.color, behind.depth);
        }
        shown.write(options, decision, frame, pixel);
    }
}

/// The pass's files and constants.
pub const PASS: Pass = Pass {
    name: "sorted",
    files: |needs| if needs.surface.lists() == Some(Lists::Sorted) { vec!["sorted.wgsl"] } else { Vec::new() },
    kernels: |_| Vec::new(),
    constants: |making| {
        let Rules { least_alpha, most_alpha, least_shown, leaves_last } = Rules::of(making.options);
        vec![
            ("LEAST_ALPHA", least_alpha),
            ("MOST_ALPHA", most_alpha),
            ("LEAST_SHOWN", least_shown),
            ("LEAVES_LAST", u32::from(leaves_last).into()),
        ]
    },
};
