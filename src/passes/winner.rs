//! Stages 2 and 3 where only the nearest fragment shows, as with a depth test (Schuetz and Wimmer
//! 2015, section III). Nothing is blended, so there is no epsilon, no weight and nothing to sum.
//!
//! A pixel shows its nearest fragment. Among fragments at the nearest depth it shows the one whose
//! colour, as a word of four bytes, is greatest, so the image does not depend on the order of the
//! surfels. With 64-bit atomics depth and colour are one number, and the visibility pass is the
//! only pass over the fragments. Otherwise a second pass stores the colours of the fragments at the
//! nearest depth, which gives the same bits. Colours with more bits are rounded to such words. If
//! all surfels have one colour, only the nearest depth is needed.

use super::accumulate::{PixelSums, decision};
use super::footprint::footprint;
use super::splat::Splat;
use crate::plan::pass::Pass;
use crate::plan::steps::Clear;
use crate::plan::{Plan, Settings, Surface, Winner};
use crate::scene::color::{decoded, srgb8};
use crate::scene::{Camera, Colors, Scene};

/// The pass's files.
pub const PASS: Pass = Pass {
    name: "winner",
    files: |needs| match needs.surface {
        Surface::Nearest(Winner::Depth) => vec!["winner.wgsl", "winner_constant.wgsl"],
        Surface::Nearest(Winner::Once) => vec!["winner.wgsl", "winner_color.wgsl", "srgb.wgsl"],
        Surface::Nearest(Winner::Second) => {
            vec!["winner.wgsl", "winner_second.wgsl", "winner_color.wgsl", "srgb.wgsl"]
        }
        _ => Vec::new(),
    },
    kernels: |_| Vec::new(),
    constants: |_| Vec::new(),
};

/// The clear before the visibility pass, if that pass stores colours.
pub fn clears(plan: &Plan, band: usize) -> Option<Clear> {
    let words = plan.bands[band].pixels * u64::from(plan.sum_words);
    (plan.needs.surface == Surface::Nearest(Winner::Once)).then(|| Clear::of("sums", 0, words))
}

/// The fragment that wins a pixel.
#[derive(Clone, Copy)]
struct Best {
    depth: f64,
    /// The bytes of the colour as a little-endian word.
    word: u32,
    surfel: usize,
}

/// The f64 twin, over `rows` rows from `first_row` on: the sums of the one fragment that each pixel
/// shows.
pub fn reference<'a>(
    splats: impl Iterator<Item = &'a Splat> + Clone,
    scene: &Scene,
    camera: &Camera,
    options: &Settings,
    (first_row, rows): (u32, u32),
) -> Vec<PixelSums> {
    let (low, high) = scene.color_range();
    // Colours of more than 8 bits are rounded, unless all surfels share one colour
    // (src/plan/check.rs).
    let code = |surfel: usize| match &scene.colors {
        Colors::Srgb8(codes) => Some(codes[surfel]),
        Colors::Linear(colors) if low != high => Some(srgb8(colors[surfel])),
        _ => None,
    };
    let word = |surfel: usize| code(surfel).map_or(0, u32::from_le_bytes);
    let mut best: Vec<Option<Best>> = vec![None; camera.width as usize * rows as usize];
    let fragments = |visit: &mut dyn FnMut(usize, &Splat, super::splat::Intersection)| {
        for splat in splats.clone() {
            for y in splat.first[1].max(first_row)..=splat.last[1].min(first_row + rows - 1) {
                for x in splat.first[0]..=splat.last[0] {
                    let pixel = (y - first_row) as usize * camera.width as usize + x as usize;
                    footprint(splat, camera, options.low_pass, x, y)
                        .into_iter()
                        .for_each(|(at, _)| visit(pixel, splat, at));
                }
            }
        }
    };
    fragments(&mut |pixel, splat, at| {
        let own = Best { depth: at.depth, word: word(splat.surfel as usize), surfel: splat.surfel as usize };
        let wins = |other: Best| own.depth < other.depth || (own.depth == other.depth && own.word > other.word);
        if at.hit(camera) && best[pixel].is_none_or(wins) {
            best[pixel] = Some(own);
        }
    });
    let mut sums = vec![PixelSums::ZERO; best.len()];
    fragments(&mut |pixel, splat, at| {
        let behind = match best[pixel] {
            // Whether the winner itself is accepted depends only on its rim and the near depth.
            Some(best) if best.surfel != splat.surfel as usize => best.depth,
            _ => f64::INFINITY,
        };
        sums[pixel].decision = sums[pixel].decision.min(decision(at, behind, camera.near));
    });
    for (sum, best) in sums.iter_mut().zip(best) {
        let Some(best) = best else { continue };
        let color = code(best.surfel).map_or_else(|| scene.colors.linear(best.surfel), decoded);
        let [r, g, b, alpha] = color.map(f64::from);
        let color = [r * alpha, g * alpha, b * alpha, alpha];
        *sum = PixelSums { weight: 1.0, color, depth: best.depth, depth_weight: 1.0, count: 1, ..*sum };
    }
    sums
}
