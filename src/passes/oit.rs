//! Stage 3 of [`Composite::Weighted`] and [`Composite::Moments`]: order-independent transparency, which approximates what is
//! [`sorted`](super::sorted) by sums over all fragments of a pixel, in any order. No list is made and nothing is sorted.
//!
//! With alphas `a_i = A w_i alpha_i` (A the opacity, w_i the kernel) and straight colours c_i at depths z_i (McGuire and Bavoil 2013, Eq. 2)
//!
//!   `colour = sum(v_i a_i c_i) / sum(v_i a_i)`, `alpha = 1 - prod(1 - a_i)`.
//!
//! So what the background shows is exact, and the order shows only by v_i. It should be what lies before the fragment lets through, and is
//!
//! - **weighted**: `max((1 - d)^3, 1 / 300,000)` (theirs, Eq. 10, over its greatest value), where d goes from 0 where the scene's body starts
//!   to 1 where it ends; what strays lies at the one or the other. Theirs is between the clip planes, which a scene need not fill;
//! - **moments**: what the moments of all fragments say ([`moments`]).
//!
//! The product is kept as the sum of `-ln(1 - a_i)`. By the accumulator `fixed` sums are integers, so here too the order of fragments shows
//! nowhere; by `float` and `cas`, which are as others have it, it does.
//!
//! Splats are lit, not pixels, as the mean of the normals of several surfaces is that of none.

use super::accumulate::{PixelSums, decision};
use super::footprint::footprint;
use super::moments::{self, Moments};
use super::splat::{Intersection, Splat};
use super::{Strip, attributes};
use crate::plan::pass::Pass;
use crate::plan::steps::{Kernel, Over, Run, Stage};
use crate::plan::{Oit, RenderOptions, SceneNeeds};
use crate::scene::Composite;
use crate::scene::kernel::LEAST_WEIGHT;

/// The least weight by depth.
const LEAST_OF_DEPTH: f64 = 1.0 / 300_000.0;

/// No alpha is nearer to 1.
const LEAST_LEFT: f64 = 1.0 / (1u64 << 40) as f64;

/// What a fragment of that alpha holds back: optical depth, at most 28.
pub(super) fn held_back(alpha: f64) -> f64 {
    -(1.0 - alpha).max(LEAST_LEFT).ln()
}

/// A fragment as the twins see it.
pub(super) struct Fragment {
    /// Its pixel in the strip.
    pub pixel: usize,
    /// Camera-space z, world units.
    pub depth: f64,
    /// Of the kernel.
    pub weight: f64,
    /// Premultiplied, lit if there is light.
    pub color: [f64; 4],
}

impl Fragment {
    /// Times the opacity and the weight.
    pub fn alpha(&self, options: &RenderOptions) -> f64 {
        f64::from(options.opacity) * self.weight * self.color[3]
    }
}

/// Visits what lies near the disks of `strip`, and the fragments.
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
                    let weight = (gain * options.kernel.weight(at.rho2)).max(LEAST_WEIGHT);
                    fragment(Fragment { pixel, depth: at.depth, weight, color });
                }
            }
        }
    };
    strip.splats.iter().for_each(|splat| of_splat(splat, &mut near, &mut fragment));
}

/// The twin: the sums of the pixels of `strip`.
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
    let near = |pixel: usize, at| decisions[pixel] = decision(at, f64::INFINITY, camera.near).min(decisions[pixel]);
    visit(strip, near, |f| {
        let (sum, weight) = (&mut sums[f.pixel], f.weight * before(&f));
        sum.weight += weight;
        sum.depth_weight += weight;
        sum.color.iter_mut().zip(f.color).for_each(|(total, value)| *total += weight * value);
        sum.held_back += held_back(f.alpha(options));
        sum.count += 1;
    });
    sums.into_iter().zip(decisions).map(|(sum, decision)| PixelSums { decision, ..sum }).collect()
}

/// The files, kernels and constants.
pub const PASS: Pass = Pass {
    name: "oit",
    files: |needs| match needs.oit {
        None => vec!["oit_absent.wgsl"],
        Some(Oit::Weighted) => vec!["oit.wgsl", "oit_weighted.wgsl"],
        Some(Oit::Moments) => vec!["oit.wgsl", "oit_moments.wgsl"],
    },
    kernels: |needs| if marks(needs) { vec![MARK] } else { Vec::new() },
    constants: |_| Vec::new(),
};

const MARK: Kernel = Kernel::new("mark_covered");

/// Whether sums say where anything is, as there is no visibility pass.
pub fn marks(needs: &SceneNeeds) -> bool {
    needs.oit == Some(Oit::Weighted)
}

/// Where anything is.
pub fn mark(band: usize) -> Stage {
    Stage::new("visibility", band, vec![Run { kernel: MARK, over: Over::Pixels }])
}
