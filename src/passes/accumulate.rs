//! Stage 3: over the fragments within epsilon of the nearest depth, the sums of weight and of weight times attribute
//! (paper 000, Eq. 9 and 10).
//!
//! # The `fixed` accumulator
//!
//! Each fragment is turned into integers before anything is added, and integer addition is associative: the sums, and
//! so the image, do not depend on the order of the surfels, on pages, or on the schedule.
//!
//! With W = round(2^24 w), at least 1, a fragment adds W to the weight and round(W a) to each attribute, a mapped from
//! the scene's own range to [0, 1]. Sums have 64 bits in two words: `before = atomicAdd(low, x)`; if that wrapped,
//! `atomicAdd(high, 1)`. They overflow after 2^40 fragments of full weight.
//!
//! **Error bound.** For n accepted fragments the rounded terms give a mean that differs from the exact mean of the
//! rounded weights by at most `n / (2 sum W)`, of the range; rounding the weights themselves moves it by at most
//! `n / (2 sum W)` times the spread of the fragments' attributes, both plus a relative 2^-24 for each f32 operation. For
//! one fragment at the rim of the default kernel (w = exp(-6)) that is 1.2e-5 of the range; for full weights 3e-8.

use super::footprint::intersect;
use super::project::{Splat, SplatBuffer};
use super::visibility::VisibilityBuffer;
use super::{Recorder, Rows};
use crate::error::Result;
use crate::gpu::buffers::Buffer;
use crate::scene::{Camera, RenderOptions, Scene};

/// An accumulator: one row of the table below, one file `wgsl/accumulator_*.wgsl`.
#[derive(Clone, Copy, Debug)]
pub struct Accumulator {
    /// Its name.
    pub name: &'static str,
    /// Its file.
    pub file: &'static str,
    /// u32 words of one sum.
    pub words: u32,
    /// The image's bits are the same for any order of fragments.
    pub deterministic: bool,
    /// Bound on the error of a mean of n fragments with summed weight w, as a fraction of the attribute's range.
    pub error_bound: fn(n: f64, w: f64) -> f64,
}

/// Every accumulator.
pub const ACCUMULATORS: &[Accumulator] = &[Accumulator {
    name: "fixed",
    file: "accumulator_fixed.wgsl",
    words: crate::gpu::layout::SUM_WORDS,
    deterministic: true,
    error_bound: |n, w| n / (w * f64::from(crate::gpu::layout::ONE)) + 4.0 / 16_777_216.0,
}];

/// The sums of one pixel, in f64: weight, weight times attributes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelSums {
    /// Sum of weights.
    pub weight: f64,
    /// Of the premultiplied linear colour.
    pub color: [f64; 4],
    /// Of the normal.
    pub normal: [f64; 3],
    /// Of the depth.
    pub depth: f64,
    /// Accepted fragments.
    pub count: u32,
    /// The smallest relative distance of a fragment to a decision; see [`crate::scene::Maps::decision`].
    pub decision: f64,
}

impl PixelSums {
    /// Nothing yet.
    pub const ZERO: Self =
        Self { weight: 0.0, color: [0.0; 4], normal: [0.0; 3], depth: 0.0, count: 0, decision: f64::INFINITY };
}

/// How far outside a decision a fragment is still looked at to record its distance, relative.
const NEARBY: f64 = 1e-3;

/// The twin, over the rows of `nearest`, which the twin of the visibility pass made.
pub fn reference<'a>(
    splats: impl Iterator<Item = &'a Splat>,
    scene: &Scene,
    camera: &Camera,
    options: &RenderOptions,
    first_row: u32,
    nearest: &[f64],
) -> Vec<PixelSums> {
    let width = camera.width as usize;
    let rows = (nearest.len() / width) as u32;
    let (relative, absolute) = options.epsilon.parts();
    let mut sums = vec![PixelSums::ZERO; nearest.len()];
    for splat in splats {
        let [r, g, b, alpha] = scene.colors.linear(splat.surfel as usize).map(f64::from);
        let color = [r * alpha, g * alpha, b * alpha, alpha];
        let normal = if splat.away && !scene.oriented { -splat.normal } else { splat.normal };
        for y in splat.first[1].max(first_row)..=splat.last[1].min(first_row + rows - 1) {
            let row = (y - first_row) as usize * width;
            for x in splat.first[0]..=splat.last[0] {
                let Some(at) = intersect(splat, camera, x, y) else { continue };
                let pixel = row + x as usize;
                let back = nearest[pixel] * (1.0 + relative) + absolute;
                let sum = &mut sums[pixel];
                if options.maps.decision {
                    sum.decision = sum.decision.min(decision(at.rho2.sqrt(), at.depth, back, camera.near));
                }
                if !(at.hit(camera) && at.depth <= back) {
                    continue;
                }
                let weight = options.kernel.weight(at.rho2);
                sum.weight += weight;
                for (total, value) in sum.color.iter_mut().zip(color) {
                    *total += weight * value;
                }
                for (total, value) in sum.normal.iter_mut().zip(normal.to_array()) {
                    *total += weight * value;
                }
                sum.depth += weight * at.depth;
                sum.count += 1;
            }
        }
    }
    sums
}

/// The relative distance to the nearest decision that could turn the fragment's fate: it is in or out by rim, near
/// depth and epsilon together, so a fragment that fails one of them clearly is not undecided by the others.
fn decision(rho: f64, depth: f64, back: f64, near: f64) -> f64 {
    let margins = [1.0 - rho, depth / near - 1.0, if back.is_finite() { back / depth - 1.0 } else { f64::INFINITY }];
    if margins.iter().any(|m| *m < -NEARBY) {
        f64::INFINITY
    } else {
        margins.map(f64::abs).into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// The sums of each pixel of some rows.
pub struct AttributeBuffer {
    /// [`PixelLayout::sum_words`](crate::gpu::kernel::PixelLayout::sum_words) a pixel.
    pub sums: Buffer<u32>,
}

impl AttributeBuffer {
    /// Room for `pixels`.
    pub fn new(recorder: &Recorder<'_>, pixels: u64) -> Result<Self> {
        let words = pixels * u64::from(recorder.pixel.sum_words);
        Ok(Self { sums: Buffer::storage(recorder.gpu, "weighted sums", words)? })
    }
}

/// Records the pass over `rows`.
pub fn record(
    recorder: &mut Recorder<'_>,
    splats: &SplatBuffer,
    rows: &Rows,
    visible: &VisibilityBuffer,
    buffer: &AttributeBuffer,
) -> Result<()> {
    let buffers = [("visible", &visible.nearest.raw), ("sums", &buffer.sums.raw)];
    splats.dispatch(recorder, ("accumulate", "accumulate_large"), rows, &buffers, |encoder| {
        encoder.clear_buffer(&buffer.sums.raw, 0, None)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_accumulator_has_its_file_and_the_words_that_buffers_are_laid_out_for() {
        for row in ACCUMULATORS {
            assert!(crate::gpu::kernel::FILES.iter().any(|(name, _)| *name == row.file), "{}", row.file);
            assert_eq!(row.words, crate::gpu::layout::SUM_WORDS);
        }
    }

    #[test]
    fn a_decision_is_near_only_if_nothing_else_decides() {
        // Just inside the rim, well inside the tolerance.
        assert!((decision(1.0 - 1e-7, 2.0, 2.2, 0.1) - 1e-7).abs() < 1e-12);
        // At the rim, but far behind the tolerance: out either way.
        assert_eq!(decision(1.0 - 1e-7, 2.0, 1.0, 0.1), f64::INFINITY);
        // At the tolerance, but outside the disk.
        assert_eq!(decision(1.5, 2.0, 2.0, 0.1), f64::INFINITY);
        assert_eq!(decision(0.5, 2.0, 2.0, 0.1), 0.0);
    }
}
