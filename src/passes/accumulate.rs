//! Stage 3: sums weight, and weight times attribute, over the fragments within epsilon of the
//! nearest depth and on its side of the surface (paper 000, Eq. 9 and 10).
//!
//! # Accumulators
//!
//! Let W be a fragment's weight w in the units of its sum, and a its attribute, mapped from the
//! scene's own range to [0, 1]. A fragment adds W to the weight and W a to each attribute. The mean
//! of n accepted fragments of summed weight w then errs by at most
//! [`AccumulatorRow::error_bound`](crate::plan::AccumulatorRow::error_bound), as a fraction of the
//! attribute's range, in addition to the errors of the fragments themselves. Let u = 2^-24, the
//! rounding of one f32 operation.
//!
//! - **fixed**: W = round(F w) with F = 2^32 - 2^10, so that a term fills a word. W a is rounded to
//!   f32 and then to an integer. Integer addition is associative: the sums, and so the image, do
//!   not depend on the order of the surfels, on pages, or on the schedule. A sum has 64 bits in two
//!   words: `before = atomicAdd(low, x)`; if that wrapped, `atomicAdd(high, 1)`. It overflows after
//!   2^32 full weights. A sum carries once per full weight, which is less often than once per
//!   fragment; on a software adapter carries take a fifth of the pass.
//!
//!   *Error*: rounding W a to f32 moves the mean by at most u. Rounding it to an integer errs by
//!   half a unit, which moves the mean by `n / (2 sum W)`. Rounding the weights moves the mean by
//!   at most as much again, because attributes spread by at most 1: `n / (F w)` in all. Reading a
//!   sum as f32 errs by 1.5 u: the upper word, below 2^24, is exact. If the upper word is not 0,
//!   rounding the lower word errs by at most u / 2 of the sum, and adding the two words by u. Two
//!   such sums, their division, the product that maps the mean back, and the rounding of W a give
//!   `6 u`.
//!
//!   *Small weights*: at the rim of the paper's kernel, where w = exp(-6), terms keep 23 bits.
//!   Where weights may be smaller still, or alphas differ
//!   ([`SceneNeeds::wide_sums`](crate::plan::SceneNeeds::wide_sums)), terms are those of `fixed64`
//!   in two words, and most take two additions. They have 40 fraction bits, or up to 56
//!   ([`wide_bits`]) for kernels with long tails and for order-free sums, in which far fragments
//!   weigh little. An adapter with 64-bit atomics makes the same sums in half the additions.
//! - **fixed32**: the same in one word with `B = 32 - bits(min(surfels, 255))` fraction bits. B is
//!   at least 24, so that 255 full weights (or all surfels, if fewer) can meet in a pixel. A sum
//!   that wraps is detected, and the frame is rendered again with `fixed`. Reading a sum rounds
//!   once: `n 2^-B / w + 5 u`.
//! - **fixed64**: a term is one u64. W = 2^40 w is exact; W a is rounded to f32 and cut at 2^-40.
//!   The rounding moves the mean by at most u, whatever n: `6 u + n 2^-40 / w`. A sum overflows
//!   after 2^24 full weights.
//! - **packed64**: the terms of `fixed32`, two sums in the halves of one u64.
//! - **float**, **cas**: f32 sums, by atomic add or by compare and exchange. A sum of n terms in
//!   any order errs by at most `(n - 1) u` of itself. An attribute's sum divided by the weight's
//!   errs by `2 n u + 4 u`. The image depends on the order of the fragments.
//!
//! Where surfaces are compared by their blended depths, a fragment adds `W f` and `W f z` to the
//! depth's sums, with `f = max(w, 2^-8)`. These terms are up to 256 times smaller than W, so the
//! error bounds, in which w is the summed weight, are up to 256 times larger for the depth. With
//! 24 fraction bits, terms of weights below 2^-17 round to 0. A pixel with no larger weights shows
//! its nearest depth.

use std::borrow::Cow;

use super::attributes;
use super::footprint::footprint;
use super::join;
use super::splat::{Intersection, Splat};
use super::tiles;
use super::visibility::Nearest;
use crate::gpu::layout::TILE;
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Part, Run, Stage, Twin};
use crate::plan::{Accumulator, PixelLayout, Plan, SceneNeeds, Settings, wide_bits};
use crate::scene::kernel::LEAST_WEIGHT;
use crate::scene::{Camera, Colors, Fade, Map, Scene};

/// The file that stores the sums of `fixed`.
///
/// It depends on whether terms may exceed a word, because weights may be small
/// ([`SceneNeeds::wide_sums`]) or one surfel stands for its copies
/// ([`Splats::Copies`](crate::plan::Splats::Copies)), and on whether the adapter adds 64 bits at
/// once ([`SceneNeeds::atomics_u64`]), which makes the same sums in half the additions.
fn fixed_file(needs: &SceneNeeds) -> &'static str {
    match (!needs.terms_fit(), needs.atomics_u64) {
        (false, false) => "accumulator_fixed.wgsl",
        (false, true) => PAIRS,
        // The product of a term and a number of copies is computed in single words.
        (true, true) if !needs.surface.copies() => "accumulator_fixed64.wgsl",
        (true, _) => "accumulator_fixed_wide.wgsl",
    }
}

/// Words of workgroup memory for sums (`wgsl/accumulate/sums_window.wgsl`). Together with the
/// attributes of 64 splats they fit into the 32 KiB that graphics cards grant.
const WINDOW_WORDS: u32 = 5760;

/// The blocks of 4 pixels whose sums fit into workgroup memory. A pixel has a word for each of its
/// `channels`, and one for the carries of four.
fn window(channels: u32) -> u32 {
    (WINDOW_WORDS / (4 * (channels + channels.div_ceil(4)).max(1))).min(288)
}

/// The splats of a workgroup. A square of 256 splats with radii of 1.5 spacings and 2.3 pixels, as
/// on a sphere of 1,000,000 at 1024x1024, covers 30 x 30 pixels, and one of 128 splats 22 x 22.
fn spread_splats(channels: u32) -> u32 {
    match window(channels) {
        192.. => 256,
        96.. => 128,
        _ => 64,
    }
}

/// The file that adds two sums of `fixed` at once, as the halves of one 64-bit number.
const PAIRS: &str = "accumulator_fixed_pairs.wgsl";

/// The file that computes the terms of `fixed`.
pub(super) fn terms_file(needs: &SceneNeeds) -> &'static str {
    if needs.wide_sums { "terms_wide.wgsl" } else { "terms.wgsl" }
}

/// The files that store the sums of a render with `needs` in storage buffers.
pub fn files(needs: &SceneNeeds) -> Vec<&'static str> {
    match needs.accumulator {
        Accumulator::Fixed if needs.terms_fit() => vec![terms_file(needs), fixed_file(needs), "sums_direct.wgsl"],
        Accumulator::Fixed => vec![terms_file(needs), fixed_file(needs)],
        Accumulator::Fixed64 => vec!["terms_wide.wgsl", "accumulator_fixed64.wgsl"],
        other => vec![other.row().file],
    }
}

/// The files that keep the sums of a tile's pixels in registers. Those of [`files`] keep sums in
/// storage buffers.
pub fn tile_files(needs: &SceneNeeds) -> [&'static str; 4] {
    let pairs = fixed_file(needs) == PAIRS;
    [
        terms_file(needs),
        "tile_add.wgsl",
        if tiles::staged(needs) { "staged_sums.wgsl" } else { "tile_sums.wgsl" },
        if pairs { "tile_deposit_pairs.wgsl" } else { "tile_deposit.wgsl" },
    ]
}

/// Whether a device adds two sums of `fixed` at once for these needs; other numbers of 64 bits are
/// stored one by one.
fn in_pairs(needs: Option<&SceneNeeds>) -> bool {
    needs.is_some_and(|needs| fixed_file(needs) == PAIRS)
}

/// Makes `numbers` of the words in which a device stores them, two for each: the low word first, or
/// the sums of `fixed` in a render with `needs`.
pub fn canonical(needs: Option<&SceneNeeds>, stored: &[u32], numbers: &mut [u64]) {
    let long = |low: u32, high: u32| u64::from(high) << 32 | u64::from(low);
    if !in_pairs(needs) {
        numbers.iter_mut().zip(stored.as_chunks().0).for_each(|(number, &[low, high])| *number = long(low, high));
        return;
    }
    // Subtracts from the high half what the low half carried into it
    // (accumulator_fixed_pairs.wgsl).
    for (pair, &[low, high, from_low, from_high]) in numbers.as_chunks_mut().0.iter_mut().zip(stored.as_chunks().0) {
        *pair = [long(low, from_low), long(high, from_high).wrapping_sub(from_low.into())];
    }
}

/// The words in which a device stores `numbers`: the inverse of [`canonical`].
pub fn kept<'a>(needs: Option<&SceneNeeds>, numbers: &'a [u64]) -> Cow<'a, [u32]> {
    let [low, high] = [|long: u64| long as u32, |long: u64| (long >> 32) as u32];
    if in_pairs(needs) {
        let pair = |&[first, second]: &[u64; 2]| {
            let carried = second.wrapping_add(first >> 32);
            [low(first), low(carried), high(first), high(carried)]
        };
        return numbers.as_chunks().0.iter().flat_map(pair).collect();
    }
    match cfg!(target_endian = "little") {
        true => Cow::Borrowed(bytemuck::cast_slice(numbers)),
        false => numbers.iter().flat_map(|&number| [low(number), high(number)]).collect(),
    }
}

/// The sums of one pixel, in f64: weights, and weights times attributes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelSums {
    /// The sum of the weights.
    pub weight: f64,
    /// The sum of the premultiplied linear colour.
    pub color: [f64; 4],
    /// The sum of the normals, turned toward the viewer: otherwise front and back of a thin part
    /// would cancel.
    pub normal: [f64; 3],
    /// Whether the visible side is the back.
    pub back: bool,
    /// The sum of the depths, weighted as in `depth_weight`.
    pub depth: f64,
    /// The sum of the factors of the depths: the weights or, where surfaces are compared by depth,
    /// about their squares ([`LEAST_MIDDLE`]).
    pub depth_weight: f64,
    /// The depth of the nearest fragment; set for lists only.
    pub nearest: f64,
    /// The sums of [`Textured::terms`](crate::scene::Textured::terms), positions in a texture.
    pub place: [f64; 5],
    /// The optical depth of all fragments; set where all of a pixel's fragments are summed
    /// ([`oit`](super::oit)).
    pub held_back: f64,
    /// The number of accepted fragments.
    pub count: u32,
    /// The smallest relative distance of a fragment to a decision; see [`Map::Decision`].
    pub decision: f64,
}

impl PixelSums {
    /// Sums of no fragments.
    pub const ZERO: Self = Self {
        weight: 0.0,
        color: [0.0; 4],
        normal: [0.0; 3],
        back: false,
        depth: 0.0,
        depth_weight: 0.0,
        nearest: f64::INFINITY,
        place: [0.0; 5],
        held_back: 0.0,
        count: 0,
        decision: f64::INFINITY,
    };
}

/// The smallest factor on a fragment's weight in the depth sums where surfaces are compared by
/// depth.
///
/// In these sums each weight is multiplied by itself, or by this bound if that is larger. The bound
/// ensures that every covered pixel has a depth.
pub const LEAST_MIDDLE: f64 = 1.0 / 256.0;

/// A fragment that a test rejects by at most this relative margin still records the margin.
const NEARBY: f64 = 1e-3;

/// The f64 twin, over the rows of `nearest`, the result of the visibility pass's twin.
pub fn reference<'a>(
    splats: impl Iterator<Item = &'a Splat>,
    scene: &Scene,
    camera: &Camera,
    options: &Settings,
    first_row: u32,
    nearest: &[Nearest],
) -> Vec<PixelSums> {
    let width = camera.width as usize;
    let rows = (nearest.len() / width) as u32;
    let mut sums = vec![PixelSums::ZERO; nearest.len()];
    let compares_depth = join::compares_depth(scene, camera, options);
    for splat in splats {
        let surfel = &scene.surfels[splat.surfel as usize];
        let center = scene.origin + scene.center(splat.surfel as usize);
        let color = attributes::color(scene, splat, camera, options);
        let radius = f64::from(surfel.shorter());
        let times = f64::from(splat.copies);
        for y in splat.first[1].max(first_row)..=splat.last[1].min(first_row + rows - 1) {
            let row = (y - first_row) as usize * width;
            for x in splat.first[0]..=splat.last[0] {
                let Some((at, gain)) = footprint(splat, camera, options.low_pass, x, y) else { continue };
                let (pixel, back) = (row + x as usize, splat.shows_back(&at));
                let front = nearest[pixel];
                let along = camera.along_axis(x, y);
                let behind = options.epsilon.farthest(front.depth, radius, along);
                // With fades the nearest depth is that of the sample's own cut; surfels of other
                // cuts may lie in front of it.
                let reached = options.epsilon.farthest(at.depth, radius, along);
                let sum = &mut sums[pixel];
                if options.maps.has(Map::Decision) {
                    // A fragment of the other side is rejected unless it is nearest.
                    let behind = if back == front.back { behind } else { front.depth };
                    let before = if splat.fade == Fade::WHOLE { f64::INFINITY } else { reached / front.depth - 1.0 };
                    sum.decision = sum.decision.min(decision_beside(at, behind, camera.near, before));
                }
                if !(at.hit(camera) && front.shows(at.depth, back, behind) && reached >= front.depth) {
                    continue;
                }
                sum.back = front.back;
                let once = (gain * options.weight(at.rho2)).max(LEAST_WEIGHT);
                let weight = times * once;
                sum.weight += weight;
                for (total, value) in sum.color.iter_mut().zip(color) {
                    *total += weight * value;
                }
                if let Colors::Textured(textured) = &scene.colors {
                    let (x, y) = (f64::from(x) + 0.5, f64::from(y) + 0.5);
                    let (surfel, ray) = (splat.surfel as usize, camera.ray(x, y));
                    let part = textured.part_in_pixel(surfel, camera, ray, at.depth);
                    let terms = textured.terms(surfel, camera.ray_start(x, y) + at.depth * ray - center, part);
                    for (total, value) in sum.place.iter_mut().zip(terms) {
                        *total += weight * value;
                    }
                }
                for (total, value) in sum.normal.iter_mut().zip(splat.normal_at(&at).to_array()) {
                    *total += weight * value;
                }
                let depth_weight = if compares_depth { weight * once.max(LEAST_MIDDLE) } else { weight };
                // Depths of other cuts in front of the nearest one count as the nearest, because
                // terms are clamped.
                sum.depth += depth_weight * at.depth.max(front.depth);
                sum.depth_weight += depth_weight;
                sum.count += splat.copies;
            }
        }
    }
    sums
}

/// The relative distance to the nearest decision that could change whether a fragment is accepted.
///
/// A fragment is accepted if rim, near depth and epsilon all accept it. If one of them clearly
/// rejects it, the others cannot change that, and the distance is +inf.
pub(super) fn decision(at: Intersection, behind: f64, near: f64) -> f64 {
    decision_beside(at, behind, near, f64::INFINITY)
}

/// The same as [`decision`] with one more margin, `beside`, that must accept the fragment.
fn decision_beside(at: Intersection, behind: f64, near: f64, beside: f64) -> f64 {
    let before = if behind.is_finite() { behind / at.depth - 1.0 } else { f64::INFINITY };
    let margins = [1.0 - at.rho2.sqrt(), at.inside, at.depth / near - 1.0, before, beside];
    if margins.iter().any(|m| *m < -NEARBY) {
        f64::INFINITY
    } else {
        margins.map(f64::abs).into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "accumulate",
    files: |needs| {
        let mut files = Vec::new();
        files.extend(needs.surface.accumulates().then_some("accumulate.wgsl"));
        files.extend((needs.surface.accumulates() && !needs.spreads).then_some("accumulate_alone.wgsl"));
        files
    },
    kernels: |needs| match needs.surface.accumulates() && !needs.surface.gathers() {
        true if needs.spreads => vec![ACCUMULATE_LARGE],
        true => vec![ACCUMULATE, ACCUMULATE_LARGE],
        false => Vec::new(),
    },
    constants: |making| {
        let wide = wide_bits(making.options, making.surfels);
        let channels = PixelLayout::of(making.needs).channels;
        vec![
            ("FRACTION_BITS", making.needs.accumulator.row().fraction_bits(making.surfels).into()),
            ("ONE", f64::from(wide).exp2()),
            ("WINDOW", window(channels).into()),
            ("WINDOW_SIDE", window(channels).isqrt().into()),
            ("SPREAD_SPLATS", spread_splats(channels).into()),
        ]
    },
};

/// The kernel that spreads fragments, with its files. It has a module of its own, because a kernel
/// holds all the workgroup memory that its functions name.
pub const SPREADING: Pass = Pass {
    name: "spread",
    files: |needs| vec![terms_file(needs), fixed_file(needs), "sums_window.wgsl", "accumulate_spread.wgsl"],
    kernels: |needs| if needs.surface.gathers() { Vec::new() } else { vec![SPREAD] },
    constants: |_| Vec::new(),
};

/// The files that store the sums, for a render's main module.
pub const SUMS: Pass = Pass {
    name: "sums",
    files: |needs| if needs.surface.sums_by_compute() { files(needs) } else { Vec::new() },
    kernels: |_| Vec::new(),
    constants: |_| Vec::new(),
};

const ACCUMULATE: Kernel = Kernel::new("accumulate");
/// The kernel that accumulates small splats on graphics cards.
pub const SPREAD: Kernel = Kernel::of("accumulate", [256, 1, 1]);
const ACCUMULATE_LARGE: Kernel = Kernel::of("accumulate_large", [TILE, TILE, 1]);

/// The kernel that accumulates the small splats.
fn accumulating(needs: &SceneNeeds) -> Kernel {
    if needs.spreads { SPREAD } else { ACCUMULATE }
}

/// The stage that accumulates the small splats; with separate inputs, `first` says whether this is
/// the first one.
pub fn steps(plan: &Plan, band: usize, first: bool) -> Stage {
    // The words before the sums count wrapped sums over all bands.
    let head = plan.needs.accumulator.row().head_words();
    let mut clears = vec![Clear::of("sums", head, plan.bands[band].pixels * u64::from(plan.sum_words))];
    if band == 0 && first && head > 0 {
        clears.push(Clear::of("sums", 0, head));
    }
    let runs = vec![Run { kernel: accumulating(&plan.needs), over: Over::Slots(Part::All) }];
    Stage::new("accumulate", band, runs).after(clears).as_twin(Twin::Accumulate)
}

/// The stage that accumulates the large splats, one workgroup each.
pub fn large(band: usize) -> Stage {
    Stage::new("accumulate", band, vec![Run { kernel: ACCUMULATE_LARGE, over: Over::Large }])
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    #[test]
    fn a_decision_is_near_only_if_nothing_else_decides() {
        let at =
            |rho: f64| Intersection { depth: 2.0, rho2: rho * rho, inside: 1.0, uv: DVec2::new(rho, 0.0), away: false };
        let of = |rho: f64, behind: f64| decision(at(rho), behind, 0.1);
        // Just inside the rim, well inside the tolerance.
        assert!((of(1.0 - 1e-7, 2.2) - 1e-7).abs() < 1e-12);
        // At the rim, but far behind the tolerance: rejected either way.
        assert_eq!(of(1.0 - 1e-7, 1.0), f64::INFINITY);
        // At the tolerance, but outside the disk.
        assert_eq!(of(1.5, 2.0), f64::INFINITY);
        assert_eq!(of(0.5, 2.0), 0.0);
    }
}
