//! Stage 4 of [`Composite::Sorted`] and [`Composite::Gaussians`]: every fragment of a pixel by itself, from front to back, lit at its own normal. What it shows
//! is its surfel's alpha times its weight, which the rules of Gaussians cut off.

use super::Strip;
use super::fragments::{self, Fragment};
use super::layers::Shown;
use super::resolve::shaded;
use crate::frame::Frame;
use crate::plan::pass::Pass;
use crate::plan::{Lists, RenderOptions};
use crate::scene::composite::LEAST_TRANSMITTANCE;
use crate::scene::{Composite, gaussian};

/// What of a pixel's fragments shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// Those with a smaller alpha are not listed.
    pub least_alpha: f64,
    /// Greater alphas become this one.
    pub most_alpha: f64,
    /// What would let less through than this is left out, with all behind it; else what lies behind it alone.
    pub least_shown: f64,
    /// The former.
    pub leaves_last: bool,
}

impl Rules {
    /// Those of `options`.
    pub fn of(options: &RenderOptions) -> Self {
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

/// The twin: the image of `strip`.
pub fn reference(strip: &Strip<'_>, frame: &mut Frame) {
    let Strip { scene, camera, options, first_row, .. } = *strip;
    let rules = Rules::of(options);
    // At one place the depths of two fragments are the same numbers, and the order of their surfels decides.
    let place = |f: &Fragment| {
        let surfel = f.surfel as usize;
        (scene.surfels[surfel], scene.low.get(surfel), scene.caps.get(surfel))
    };
    for (pixel, list) in fragments::reference(strip).into_iter().enumerate() {
        let at = (pixel as u32 % camera.width, pixel as u32 / camera.width + first_row);
        let (mut shown, mut decision, mut before) = (Shown::NOTHING, list.decision, None::<&Fragment>);
        let mut sensitivity = 1.0;
        for f in &list.fragments {
            let normal = if f.back { -f.normal } else { f.normal };
            let [r, g, b, alpha] = shaded(f.color, normal, camera, options, at);
            // Where a kernel falls steeply its weight errs by more than the place in the disk does.
            let steepness = 1.0 - f.weight.ln();
            let alpha = f.weight * alpha;
            if rules.least_alpha > 0.0 {
                decision = decision.min((alpha / rules.least_alpha - 1.0).abs() / steepness);
            }
            if alpha < rules.least_alpha {
                continue;
            }
            let alpha = alpha.min(rules.most_alpha);
            // Where two depths are one but for rounding, either may come first.
            if let Some(before) = before.filter(|before| place(before) != place(f)) {
                decision = decision.min(1.0 - before.depth / f.depth);
            }
            before = Some(f);
            let next = shown.with([r, g, b, alpha], f.depth);
            // So does what an alpha near 1 lets through; where what lies behind would hardly show that is of no matter.
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
        shown.write(options, decision, frame, pixel);
    }
}

/// The files and constants.
pub const PASS: Pass = Pass {
    name: "sorted",
    files: |needs| if needs.lists == Some(Lists::Sorted) { vec!["sorted.wgsl"] } else { Vec::new() },
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
