//! The index map, in a pass of its own: at each pixel, the input and the point that the visible
//! surfel of greatest weight comes from.
//!
//! Visible surfels are those within epsilon of the nearest depth. Between equal weights (on a
//! device: weights within four units in the last place of f32) the surfel that comes first in the
//! [`order`](super::order) wins. That order depends on the surfels' values, not on their places in
//! files.
//!
//! Where a triangle shows, the map has its input and face instead. A triangle shows where the
//! picture's depth is the triangle's own.
//!
//! Two sweeps over the fragments find the greatest weight, then the first surfel with that weight.
//! Both are stored in the map's words of the image. The word of a shown triangle's weight is
//! greater than that of any weight.

use super::footprint::footprint;
use super::join::Beside;
use super::visibility::Nearest;
use super::{MapPass, Strip};
use crate::frame::Frame;
use crate::gpu::layout::TILE;
use crate::plan::Plan;
use crate::plan::pass::Pass;
use crate::plan::steps::{Kernel, Over, Part, Run, Stage};
use crate::scene::kernel::LEAST_WEIGHT;
use crate::scene::{Map, Maps, Provenance};

/// The map's pass.
pub const MAP: MapPass = MapPass {
    map: Map::Index,
    pass: Pass {
        name: "index",
        files: |needs| match needs.mesh {
            Some(_) => vec!["index.wgsl", "index_triangles.wgsl"],
            None => vec!["index.wgsl"],
        },
        kernels: |needs| {
            let of_splats = [STRONGEST, STRONGEST_LARGE, NAME, NAME_LARGE];
            needs.mesh.map(|_| SHOWN_TRIANGLES).into_iter().chain(of_splats).collect()
        },
        constants: |_| Vec::new(),
    },
    runs,
    finish,
    reference,
};

const SHOWN_TRIANGLES: Kernel = Kernel::new("index_triangles");
const STRONGEST: Kernel = Kernel::new("strongest");
const STRONGEST_LARGE: Kernel = Kernel::of("strongest_large", [TILE, TILE, 1]);
const NAME: Kernel = Kernel::new("name_strongest");
const NAME_LARGE: Kernel = Kernel::of("name_strongest_large", [TILE, TILE, 1]);

/// The input and point number of an empty pixel.
pub const NOTHING: u32 = u32::MAX;

/// Whether a picture with these maps needs the map of depths to tell which triangles show.
pub fn needs_depth(maps: Maps, triangles: u64) -> bool {
    maps.has(Map::Index) && triangles > 0
}

/// The word of the weight of a shown triangle.
const OF_TRIANGLE: u32 = u32::MAX;

fn runs(plan: &Plan, band: usize) -> Stage {
    let run = |kernel, over| Run { kernel, over };
    let (slots, large) = (Over::Slots(Part::All), Over::Large);
    let of_splats = [run(STRONGEST, slots), run(STRONGEST_LARGE, large), run(NAME, slots), run(NAME_LARGE, large)];
    let of_triangles = plan.needs.mesh.map(|_| run(SHOWN_TRIANGLES, Over::Pixels));
    Stage::new("index", band, of_triangles.into_iter().chain(of_splats).collect())
}

/// The input and point number of a surfel, as bits of the two f32 that a frame stores per pixel.
fn named(provenance: &Provenance, surfel: Option<u32>) -> [f32; 2] {
    let Some(surfel) = surfel else { return [f32::from_bits(NOTHING); 2] };
    let (input, point) = provenance.of(surfel.into());
    [input, point].map(|number| f32::from_bits(u32::try_from(number).unwrap_or(NOTHING - 1)))
}

/// Converts each pixel's pair (weight, `u32::MAX` - rank) to the pair (input, point).
fn finish(words: &mut [f32], provenance: &Provenance, order: &[u32]) {
    for [weight, place] in words.as_chunks_mut().0 {
        if weight.to_bits() == OF_TRIANGLE {
            [*weight, *place] = provenance.of_triangle(place.to_bits()).map(f32::from_bits);
            continue;
        }
        let surfel = order.get((u32::MAX - place.to_bits()) as usize);
        [*weight, *place] = named(provenance, surfel.copied());
    }
}

/// The f64 twin.
fn reference(strip: &Strip<'_>, nearest: &[Nearest], beside: &Beside<'_>, frame: &mut Frame) {
    let Strip { scene, camera, options, first_row, rows, .. } = *strip;
    let depths = frame.map(Map::Depth).filter(|_| !beside.triangles.is_empty()).map(<[f32]>::to_vec);
    let (Some(ranks), Some(map)) = (strip.ranks, frame.map_mut(Map::Index)) else { return };
    let mut strongest = vec![(0.0, NOTHING, NOTHING); nearest.len()];
    for splat in &strip.splats {
        let surfel = splat.surfel as usize;
        let radius = f64::from(scene.surfels[surfel].shorter());
        for y in splat.first[1].max(first_row)..=splat.last[1].min(first_row + rows - 1) {
            for x in splat.first[0]..=splat.last[0] {
                let pixel = ((y - first_row) * camera.width + x) as usize;
                let Some((at, gain)) = footprint(splat, camera, options.low_pass, x, y) else { continue };
                let front = nearest[pixel];
                let behind = options.epsilon.farthest(front.depth, radius, camera.along_axis(x, y));
                if !at.hit(camera) || !front.shows(at.depth, splat.shows_back(&at), behind) {
                    continue;
                }
                let weight = (gain * options.weight(at.rho2)).max(LEAST_WEIGHT);
                let (most, rank, _) = strongest[pixel];
                if weight > most || (weight == most && ranks[surfel] < rank) {
                    strongest[pixel] = (weight, ranks[surfel], splat.surfel);
                }
            }
        }
    }
    for (words, (_, _, surfel)) in map.as_chunks_mut().0.iter_mut().zip(strongest) {
        *words = named(&scene.provenance, (surfel != NOTHING).then_some(surfel));
    }
    let of_pixels = map.as_chunks_mut().0.iter_mut().zip(beside.triangles).zip(depths.into_iter().flatten());
    for ((words, triangle), depth) in of_pixels {
        if triangle.depth.is_finite() && triangle.depth as f32 == depth {
            *words = scene.provenance.of_triangle(triangle.triangle).map(f32::from_bits);
        }
    }
}
