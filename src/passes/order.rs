//! Stage 0: the order in which surfels are stored on the device.
//!
//! Surfels are sorted along a Morton curve, so that neighbours in memory are neighbours in the
//! image. The curve is then cut into runs of equal length, and the runs are shuffled by a fixed
//! stride, so that consecutive runs lie far apart.
//!
//! The invocations of a subgroup then draw neighbouring splats: their loops are of similar length,
//! and hidden splats are rejected together. Runs that are processed at the same time lie far apart,
//! so their atomics do not contend. Sums and minima do not depend on the order. It decides only in
//! sorted lists, among fragments at one depth, and in the index map, among surfels of one weight.
//! There the image is still the same for any input order, because the stored order depends only on
//! the surfels' values. (Schuetz et al. 2021, "Rendering Point Clouds with Compute Shaders and
//! Vertex Order Optimization".)

use bytemuck::Zeroable;
use rayon::prelude::*;

use crate::gpu::layout::{BATCH, Page};
use crate::morton;
use crate::scene::{Bounds, Cap, Clip, Colors, Scene, Share, Surfel};

/// Surfels per run, as [`layout::RUN`](crate::gpu::layout::RUN).
const RUN: usize = crate::gpu::layout::RUN as usize;
const _: () = assert!(RUN.is_multiple_of(BATCH as usize));

/// Bits per coordinate on the curve.
const BITS: u32 = 10;

/// The index of the last cell along each axis.
const LAST: u32 = (1 << BITS) - 1;

/// The indices of the surfels of `scene` in the order in which they are stored; there are fewer
/// than 2^32.
///
/// `core` is a box that holds nearly all surfels. Surfels outside it fall into the outermost cells,
/// so that they do not make all cells larger.
///
/// Within a cell the surfels' values decide, so the device sees the same scene for any input order.
/// Only surfels that are equal in every value are ordered by index.
///
/// A `share` is a part of that order.
pub fn order(scene: &Scene, core: &Bounds, share: Option<Share>) -> Vec<u32> {
    let surfels = &scene.surfels;
    let low = core.min.as_vec3();
    let extent = core.extent().max_element() as f32;
    // Without an extent all surfels are in one cell.
    let cells = if extent > 0.0 { LAST as f32 / extent } else { 0.0 };
    let place = |(index, surfel): (usize, &Surfel)| {
        let cell = std::array::from_fn(|k| (((surfel.center[k] - low[k]) * cells) as u32).min(LAST).into());
        morton::code(cell) << 32 | index as u64
    };
    let mut along: Vec<u64> = surfels.par_iter().enumerate().map(place).collect();
    let content = |place: u64| content(scene, place as u32 as usize);
    let harmonics = |place: u64| match &scene.colors {
        Colors::Harmonics(harmonics) => bytemuck::cast_slice(harmonics.terms(place as u32 as usize)),
        _ => &[0u32; 0],
    };
    along.par_sort_unstable_by(|a, b| {
        let by_content = || content(*a).cmp(&content(*b)).then_with(|| harmonics(*a).cmp(harmonics(*b)));
        (a >> 32).cmp(&(b >> 32)).then_with(by_content).then_with(|| a.cmp(b))
    });
    // The incomplete last run stays last, so that every other run is stored as whole batches.
    let (runs, rest) = along.as_chunks::<RUN>();
    let stride = dealing(runs.len());
    let dealt = (0..runs.len()).flat_map(|turn| &runs[turn * stride % runs.len()]);
    let mut dealt: Vec<u32> = dealt.chain(rest).map(|place| *place as u32).collect();
    if let Some(share) = share {
        let own = share.range(dealt.len());
        dealt.truncate(own.end);
        dealt.drain(..own.start);
    }
    dealt
}

/// The bits of a surfel's geometry, colour and fade, as a sort key.
pub(super) fn content(scene: &Scene, index: usize) -> ([[u32; 3]; 8], [u32; 4], [Option<u32>; 2]) {
    let Surfel { center, s, t } = scene.surfels[index];
    let low = scene.low.get(index).copied().unwrap_or_default();
    let normal = scene.normals.get(index).copied().unwrap_or_default();
    let Clip([first, second]) = scene.clips.get(index).copied().unwrap_or_default();
    let Cap(cap) = scene.caps.get(index).copied().unwrap_or_default();
    let color = match &scene.colors {
        Colors::Harmonics(harmonics) => harmonics.colors()[index],
        colors => colors.linear(index),
    };
    (
        [center, low, s, t, first, second, cap, normal].map(|part| part.map(f32::to_bits)),
        color.map(f32::to_bits),
        [scene.fades.get(index).map(|fade| fade.word()), scene.thirds.get(index).map(|third| third.to_bits())],
    )
}

/// The page of a cut (`wgsl/levels/select.wgsl`) that draws `surfels` chosen surfels from number
/// `first` on, with their runs shuffled.
///
/// The list of the chosen surfels starts at word `chosen` of the branch's attributes.
pub(crate) fn dealt(surfels: u64, (chosen, first): (u32, u32)) -> Page {
    let runs = surfels / RUN as u64;
    let stride = dealing(runs as usize) as u32;
    Page { first, surfels: surfels as u32, runs: runs as u32, stride, chosen, ..Zeroable::zeroed() }
}

/// The stride by which runs are shuffled. It is near the golden ratio of `runs`, and coprime to
/// `runs`, so that steps of this stride visit each run once.
fn dealing(runs: usize) -> usize {
    let gcd = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let mut stride = (runs as f64 * 0.618_033_988_749_895) as usize;
    while gcd(stride.max(1), runs) > 1 {
        stride += 1;
    }
    stride.max(1)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::{Colors, Up};
    use crate::surfels::analytic::{Shape, generate};
    use glam::{DVec3, Vec3};

    fn scene(surfels: Vec<Surfel>) -> Scene {
        let (origin, colors) = (DVec3::ZERO, Colors::Constant([1.0; 4]));
        Scene { origin, surfels, low: vec![], colors, oriented: true, up: Up::Y, ..Scene::default() }
    }

    fn sphere(count: u64) -> (Scene, Bounds) {
        let center = |position: [f64; 3]| DVec3::from_array(position).as_vec3();
        let surfels: Vec<_> =
            generate(Shape::Sphere, count).map(|s| Surfel::disk(center(s.position), Vec3::Z, 0.1)).collect();
        (scene(surfels), Bounds { min: DVec3::splat(-1.0), max: DVec3::splat(1.0) })
    }

    #[test]
    fn every_surfel_is_stored_once() {
        for count in [1, 2, 511, 512, 513, 5000, 100_000] {
            let (scene, bounds) = sphere(count);
            let mut indices = order(&scene, &bounds, None);
            indices.sort_unstable();
            assert!(indices.iter().copied().eq(0..count as u32), "{count}");
        }
        for runs in [0, 1, 2, 3, 7, 4096] {
            let Page { stride, surfels, .. } = dealt(runs * RUN as u64 + 5, (0, 0));
            let mut turns: Vec<u64> = (0..runs).map(|run| run * u64::from(stride) % runs).collect();
            turns.sort_unstable();
            assert!(turns.into_iter().eq(0..runs) && u64::from(surfels) == runs * RUN as u64 + 5, "{runs}");
        }
        assert!(order(&scene(vec![]), &Bounds::EMPTY, None).is_empty());
        let one = vec![Surfel::disk(Vec3::ZERO, Vec3::Z, 1.0); 3];
        assert_eq!(order(&scene(one), &Bounds { min: DVec3::ZERO, max: DVec3::ZERO }, None), [0, 1, 2]);
    }

    /// Shares follow each other in the order of the scene, and each lies everywhere.
    #[test]
    fn shares_lie_everywhere() {
        let (scene, bounds) = sphere(100_000);
        let volume = |indices: &[u32]| {
            let places = indices.par_iter().map(|index| scene.center(*index as usize));
            Bounds::of(places).extent().element_product() / bounds.extent().element_product()
        };
        let mut all = Vec::new();
        for number in 1..=8 {
            let own = order(&scene, &bounds, Some(Share::new(number, 8).unwrap()));
            assert!(volume(&own) > 0.9, "{number}");
            // Control: its first run lies together.
            assert!(volume(&own[..RUN]) < 0.3, "{number}");
            all.extend(own);
        }
        assert_eq!(all, order(&scene, &bounds, None));
    }

    #[test]
    fn the_same_surfels_in_any_order_are_stored_in_one() {
        let (first, core) = sphere(5000);
        // Several surfels per cell: each has a copy that is shifted by less than a cell.
        let beside = first.surfels.iter().map(|s| Surfel { center: s.center.map(|c| c + 1e-7), ..*s });
        let first = scene(first.surfels.iter().copied().chain(beside).collect());
        let stored = |scene: &Scene| -> Vec<Surfel> {
            order(scene, &core, None).into_iter().map(|index| scene.surfels[index as usize]).collect()
        };
        let turned = scene(first.surfels.iter().rev().copied().collect());
        assert!(stored(&first) == stored(&turned));
    }

    /// The mean distance between surfels that are `step` apart in `order`.
    fn mean(Scene { surfels, .. }: &Scene, step: usize, order: &[u32]) -> f64 {
        let center = |index: u32| Vec3::from_array(surfels[index as usize].center);
        let pairs = order.iter().zip(&order[step..]).step_by(RUN);
        pairs.clone().map(|(a, b)| f64::from(center(*a).distance(center(*b)))).sum::<f64>() / pairs.count() as f64
    }

    #[test]
    fn neighbours_in_memory_are_neighbours_in_space_and_runs_are_not() {
        let (scene, bounds) = sphere(100_000);
        let stored = order(&scene, &bounds, None);
        let given: Vec<u32> = (0..scene.surfels.len() as u32).collect();
        assert!(mean(&scene, 1, &stored) < 0.03, "{}", mean(&scene, 1, &stored));
        assert!(mean(&scene, 1, &given) > 0.5, "the generator's order is already local");
        assert!(mean(&scene, RUN, &stored) > 0.5, "{}", mean(&scene, RUN, &stored));
    }

    #[test]
    fn a_surfel_outside_the_core_spoils_no_neighbourhood() {
        let (mut scene, core) = sphere(100_000);
        // A surfel past the last cell must be stored at the end of the curve, and not wrap around
        // to the first cells.
        scene.surfels.push(Surfel::disk(Vec3::splat(1.5), Vec3::Z, 0.1));
        assert_eq!(order(&scene, &core, None).last(), Some(&100_000));
        let stray = DVec3::splat(500.0);
        scene.surfels[100_000].center = stray.as_vec3().to_array();
        let near = |bounds: &Bounds| {
            let stored: Vec<u32> = order(&scene, bounds, None).into_iter().filter(|index| *index < 100_000).collect();
            mean(&scene, 1, &stored)
        };
        assert!(near(&core) < 0.03, "{}", near(&core));
        assert!(near(&core.with_point(stray)) > 0.1, "bounds would do: {}", near(&core.with_point(stray)));
    }
}
