//! Stage 3 of [`Composite::Weighted`] and [`Composite::Moments`]: order-independent transparency.
//!
//! Sums over all fragments of a pixel, in any order, approximate the picture of
//! [`sorted`](super::sorted). No list is made and nothing is sorted.
//!
//! With alphas `a_i = A w_i alpha_i` (A the opacity, w_i the kernel's weight) and straight colours
//! c_i at depths z_i (McGuire and Bavoil 2013, Eq. 2)
//!
//!   `colour = sum(v_i a_i c_i) / sum(v_i a_i)`, `alpha = 1 - prod(1 - a_i)`.
//!
//! So the alpha over the background is exact, and order enters only through the visibility v_i,
//! which approximates the transmittance in front of fragment i:
//!
//! - **weighted**: `max((1 - d)^3, 1 / 300,000)` (McGuire and Bavoil, Eq. 10, divided by its
//!   largest value), where d runs from 0 at the near end of the scene's body to 1 at its far end;
//!   outliers are clamped to these ends. The paper uses the clip planes instead, which a scene need
//!   not fill.
//! - **moments**: reconstructed from the moments of all fragments ([`moments`]).
//!
//! The product over 1 - a_i is stored as the optical depth, `sum(-ln(1 - a_i))`. With the
//! accumulator `fixed` the sums are integers, so the image does not depend on the order of the
//! fragments. With the accumulators `float` and `cas`, the kind that renderers commonly use, it
//! does.
//!
//! Splats are lit, not pixels, because the mean of several surfaces' normals is the normal of none
//! of them.

use super::accumulate::{PixelSums, decision};
use super::footprint::footprint;
use super::moments::{self, Moments};
use super::splat::{Intersection, Splat};
use super::{Strip, attributes, covered};
use crate::plan::pass::Pass;
use crate::plan::steps::{Kernel, Over, Run, Stage};
use crate::plan::{Oit, Plan, SceneNeeds, Settings};
use crate::scene::kernel::LEAST_WEIGHT;
use crate::scene::{Composite, Map};

/// The smallest depth weight v_i of `weighted`.
const LEAST_OF_DEPTH: f64 = 1.0 / 300_000.0;

/// The largest error of a fragment's visibility with which the pixel still counts as decided: the
/// difference that the random combinations of options allow (`tests/pictures/matrix/judge.rs`).
const UNSURE: f64 = 3e-4;

/// The smallest transmittance of a single fragment, so that its optical depth stays finite.
const LEAST_LEFT: f64 = 1.0 / (1u64 << 40) as f64;

/// The optical depth of a fragment of this alpha, `-ln(1 - alpha)`, at most 28.
pub(super) fn held_back(alpha: f64) -> f64 {
    -(1.0 - alpha).max(LEAST_LEFT).ln()
}

/// A fragment of the f64 twins.
pub(super) struct Fragment {
    /// The index of its pixel in the strip.
    pub pixel: usize,
    /// Camera-space z, world units.
    pub depth: f64,
    /// The kernel's weight, times the low-pass's gain and the fade.
    pub weight: f64,
    /// Premultiplied linear colour, lit if the scene is.
    pub color: [f64; 4],
}

impl Fragment {
    /// The fragment's alpha: opacity times weight times the colour's alpha.
    pub fn alpha(&self, options: &Settings) -> f64 {
        f64::from(options.opacity) * self.weight * self.color[3]
    }
}

/// Calls `near` for every footprint of the splats of `strip`, hit or not, and `fragment` for hits.
pub(super) fn visit(strip: &Strip<'_>, mut near: impl FnMut(usize, Intersection), mut fragment: impl FnMut(Fragment)) {
    let Strip { scene, camera, options, first_row, rows, .. } = *strip;
    let of_splat = |splat: &Splat, near: &mut dyn FnMut(usize, Intersection), fragment: &mut dyn FnMut(Fragment)| {
        let color = attributes::color(scene, splat, camera, options);
        for y in splat.first[1].max(first_row)..=splat.last[1].min(first_row + rows - 1) {
            for x in splat.first[0]..=splat.last[0] {
                let Some((at, gain)) = footprint(splat, camera, options.low_pass, x, y) else { continue };
                let pixel = ((y - first_row) * camera.width + x) as usize;
                near(pixel, at);
                if at.hit(camera) {
                    let weight = (gain * options.weight(at.rho2)).max(LEAST_WEIGHT);
                    fragment(Fragment { pixel, depth: at.depth, weight, color });
                }
            }
        }
    };
    strip.splats.iter().for_each(|splat| of_splat(splat, &mut near, &mut fragment));
}

/// The f64 twin: the sums of the pixels of `strip`.
pub fn reference(strip: &Strip<'_>) -> Vec<PixelSums> {
    let Strip { camera, options, rows, depths, .. } = *strip;
    let [first, last] = depths;
    let moments: Option<Vec<(Moments, f64)>> =
        (options.composite == Composite::Moments).then(|| moments::reference(strip));
    let before = |f: &Fragment| match &moments {
        Some(moments) => {
            let (moments, first) = &moments[f.pixel];
            moments.let_through(moments::place(f.depth, depths), *first)
        }
        None => ((last - f.depth) / (last - first)).clamp(0.0, 1.0).powi(3).max(LEAST_OF_DEPTH),
    };
    let mut decisions = vec![f64::INFINITY; camera.width as usize * rows as usize];
    let mut sums = vec![PixelSums::ZERO; decisions.len()];
    let mut unsure = vec![false; sums.len()];
    let near = |pixel: usize, at| decisions[pixel] = decision(at, f64::INFINITY, camera.near).min(decisions[pixel]);
    visit(strip, near, |f| {
        let (sum, weight) = (&mut sums[f.pixel], f.weight * before(&f));
        sum.weight += weight;
        sum.depth_weight += weight;
        sum.color.iter_mut().zip(f.color).for_each(|(total, value)| *total += weight * value);
        sum.held_back += held_back(f.alpha(options));
        sum.count += 1;
        if let Some(moments) = moments.as_ref().filter(|_| options.maps.has(Map::Decision)) {
            let (moments, first) = &moments[f.pixel];
            unsure[f.pixel] |= moments.unsure(moments::place(f.depth, depths), *first) > UNSURE;
        }
    });
    // Rounding decides a pixel whose moments do not tell how much its fragments show.
    let decisions = decisions.into_iter().zip(unsure).map(|(decision, unsure)| if unsure { 0.0 } else { decision });
    sums.into_iter().zip(decisions).map(|(sum, decision)| PixelSums { decision, ..sum }).collect()
}

/// The pass's files, kernels and constants.
pub const PASS: Pass = Pass {
    name: "oit",
    files: |needs| match needs.surface.oit() {
        None => vec!["oit_absent.wgsl"],
        Some(Oit::Weighted) => vec!["oit.wgsl", "oit_weighted.wgsl"],
        Some(Oit::Moments) => vec!["oit.wgsl", "oit_moments.wgsl"],
    },
    kernels: |needs| if marks(needs) { vec![MARK] } else { Vec::new() },
    constants: |_| Vec::new(),
};

const MARK: Kernel = Kernel::new("mark_covered");

/// Whether a kernel marks the pixels that are not empty, by their sums, because there is no
/// visibility pass.
pub fn marks(needs: &SceneNeeds) -> bool {
    needs.surface.oit() == Some(Oit::Weighted)
}

/// The stage that marks the pixels that are not empty.
pub fn mark(plan: &Plan, band: usize) -> Stage {
    Stage::new("visibility", band, vec![Run { kernel: MARK, over: Over::Pixels }])
        .after(vec![covered::restart(plan, band)])
}
