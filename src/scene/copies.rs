//! Copies: equal surfels are drawn once, and each fragment's contribution is multiplied by their
//! number.
//!
//! A scanner that writes one point for everything it did not see produces a million equal disks,
//! all of which cover the same pixels. A sum of n equal integers is n times one of them, so with
//! the accumulator `fixed` sums and fragment counts stay the same to the bit. The f64 twin
//! multiplies too, with fewer roundings.

use std::cmp::Ordering;

use rayon::prelude::*;

use super::{Colors, Scene};

/// The most surfels that are sampled to find out whether there are copies.
const SAMPLED: usize = 4096;

/// The fewest copies of one surfel that are worth a search; with fewer, drawing each copy costs
/// less than drawing the scene without tiles. A disk that covers a 1024x1024 image takes a software
/// adapter 4 ms.
const FEWEST: usize = 1024;

/// Whether one surfel of `scene` seems to have at least [`FEWEST`] copies, from a sample of fixed
/// stride. Always false for textures and harmonics.
pub(crate) fn has_copies(scene: &Scene) -> bool {
    if matches!(scene.colors, Colors::Textured(_) | Colors::Harmonics(_)) {
        return false;
    }
    let step = scene.surfels.len().div_ceil(SAMPLED).max(1);
    let mut sample: Vec<usize> = (0..scene.surfels.len()).step_by(step).collect();
    sample.sort_unstable_by(|&a, &b| by_content(scene, a, b));
    let runs = sample.chunk_by(|&a, &b| by_content(scene, a, b).is_eq());
    runs.map(|run| if run.len() > 1 || step == 1 { run.len() * step } else { 0 })
        .max()
        .is_some_and(|most| most >= FEWEST)
}

/// The number of copies of each surfel: the full count at the first of equal surfels, 0 at the
/// others.
pub(crate) fn copies(scene: &Scene) -> Vec<u32> {
    let mut order: Vec<u32> = (0..scene.surfels.len() as u32).collect();
    let compare = |a: u32, b: u32| by_content(scene, a as usize, b as usize);
    order.par_sort_unstable_by(|&a, &b| compare(a, b).then(a.cmp(&b)));
    let mut copies = vec![0; order.len()];
    for run in order.chunk_by(|&a, &b| compare(a, b).is_eq()) {
        copies[run[0] as usize] = run.len() as u32;
    }
    copies
}

/// Orders two surfels by all their visible attributes except harmonics and texture coordinates.
pub(crate) fn by_content(scene: &Scene, a: usize, b: usize) -> Ordering {
    let bits = |index: usize| {
        let surfel = &scene.surfels[index];
        let low = scene.low.get(index).copied().unwrap_or_default();
        let normal = scene.normals.get(index).copied().unwrap_or_default();
        [surfel.center, surfel.s, surfel.t, low, normal].map(|v| v.map(f32::to_bits))
    };
    let clip = |index: usize| scene.clips.get(index).copied().unwrap_or_default().0.map(|line| line.map(f32::to_bits));
    let cap = |index: usize| scene.caps.get(index).copied().unwrap_or_default().0.map(f32::to_bits);
    let color = |index: usize| match &scene.colors {
        Colors::Constant(_) | Colors::Textured(_) | Colors::Harmonics(_) => [0; 4],
        Colors::Srgb8(codes) => codes[index].map(u32::from),
        Colors::Linear(colors) => colors[index].map(f32::to_bits),
    };
    bits(a)
        .cmp(&bits(b))
        .then_with(|| clip(a).cmp(&clip(b)))
        .then_with(|| cap(a).cmp(&cap(b)))
        .then_with(|| {
            scene.thirds.get(a).map(|third| third.to_bits()).cmp(&scene.thirds.get(b).map(|third| third.to_bits()))
        })
        .then_with(|| scene.fades.get(a).map(|fade| fade.word()).cmp(&scene.fades.get(b).map(|fade| fade.word())))
        .then_with(|| color(a).cmp(&color(b)))
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::scene::{Surfel, Up};

    /// Cycles through `places` positions, with a second colour for every sixth surfel.
    fn scene(count: usize, places: usize) -> Scene {
        let surfels =
            (0..count).map(|k| Surfel::disk(Vec3::new((k % places) as f32, 0.0, 0.0), Vec3::Z, 0.1)).collect();
        let colors = Colors::Srgb8((0..count).map(|k| [if k % 6 == 5 { 9 } else { 8 }, 8, 8, 255]).collect());
        Scene { origin: DVec3::ZERO, surfels, low: vec![], colors, oriented: true, up: Up::Y, ..Scene::default() }
    }

    #[test]
    fn equal_surfels_are_counted_at_the_first_of_them() {
        assert_eq!(copies(&scene(13, 3)), [5, 4, 2, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0]);
        assert!(copies(&scene(0, 1)).is_empty());
    }

    #[test]
    fn many_copies_are_noticed_and_few_are_not() {
        assert!(has_copies(&scene(100_000, 10)));
        assert!(has_copies(&scene(1300, 1)));
        assert!(!has_copies(&scene(900, 1)));
        assert!(!has_copies(&scene(100_000, 50_000)));
        assert!(!has_copies(&scene(1_000_000, 1_000_000)));
        assert!(!has_copies(&scene(0, 1)));
    }
}
