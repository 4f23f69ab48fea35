//! Stages 2 to 4 where inputs are kept separate: Tien's individuals (2008, chapter 5), which do not
//! blend however close they lie.
//!
//! The inputs are drawn one after the other: each is blended by itself and shaded, with nearest
//! depths and sums in buffers that the next input reuses. Each pixel keeps the shaded surface with
//! the nearest blended depth, as splats are compared with triangles ([`join`](super::join)). So any
//! number of inputs may meet at a pixel. A picture takes as long as pictures of its inputs one by
//! one, and eight more words per pixel, or sixteen with maps or triangles.

use super::resolve::Surface;
use super::{Strip, accumulate, resolve, visibility};
use crate::plan::Plan;
use crate::plan::extra;
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Run, Stage};

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "individuals",
    files: |needs| match needs.surface.separate() {
        true => vec!["individuals.wgsl"],
        // With lists or peeled layers there are no separate inputs.
        false if needs.surface.lists().is_some() || needs.surface.peels().is_some() => Vec::new(),
        false => vec!["individuals_absent.wgsl"],
    },
    kernels: |needs| if needs.surface.separate() { vec![KEEP, LIST] } else { Vec::new() },
    constants: |making| vec![("INDIVIDUAL_VECTORS", (extra::words_of("individuals", making.needs) / 4).into())],
};

const KEEP: Kernel = Kernel::new("keep_individual");
const LIST: Kernel = Kernel::new("list_individuals");

/// The dispatch that lists the tiles in which any input is visible.
pub const LISTS: Run = Run { kernel: LIST, over: Over::Occlusion };

/// The stage that shades the sums of an input and keeps its surface at the pixels where that is the
/// nearest so far.
pub fn keep(plan: &Plan, band: usize, first: bool) -> Stage {
    let runs = vec![Run { kernel: KEEP, over: Over::Covered }];
    Stage::new("resolve", band, runs).after(clear(plan, band, first).into_iter().collect())
}

/// The clear of the kept surfaces before the `first` input is kept.
pub fn clear(plan: &Plan, band: usize, first: bool) -> Option<Clear> {
    extra::clear("individuals", plan, band).filter(|_| first)
}

/// The f64 twin: the surfaces of one input at the pixels of `strip`.
pub fn reference(strip: &Strip<'_>, individual: usize) -> Vec<Surface> {
    let Strip { scene, camera, options, first_row, rows, .. } = *strip;
    let own = scene.provenance.ranges(scene.surfels.len() as u64).nth(individual).unwrap_or(0..0);
    let splats = || strip.splats.iter().copied().filter(|splat| own.contains(&splat.surfel.into()));
    let nearest = visibility::reference(splats(), camera, options.low_pass, first_row, rows);
    let sums = accumulate::reference(splats(), scene, camera, options, first_row, &nearest);
    resolve::surfaces(&sums, &nearest, (scene, camera, options), first_row)
}

/// The f64 twin: stores in `kept`, at each pixel, the nearer of the surfaces in `kept` and `shown`,
/// with the smallest distance to a decision of either.
pub fn keep_nearest(kept: &mut [Surface], shown: Vec<Surface>) {
    for (kept, shown) in kept.iter_mut().zip(shown) {
        let both = kept.exists() && shown.exists();
        let apart = if both { (shown.depth / kept.depth - 1.0).abs() } else { f64::INFINITY };
        let decision = kept.decision.min(shown.decision).min(apart);
        if shows_before(&shown, kept) {
            *kept = shown;
        }
        kept.decision = decision;
    }
}

/// Whether `a` is shown in place of `b`: it is nearer, or at equal depth greater in the first value
/// that differs.
fn shows_before(a: &Surface, b: &Surface) -> bool {
    let values = |of: &Surface| {
        let [x, y, z] = of.normal.to_array();
        let [red, green, blue, alpha] = of.color;
        let [u, v] = of.place;
        [-of.depth, red, green, blue, alpha, x, y, z, of.weight, u, v, of.count.into(), of.front]
    };
    a.exists() && (!b.exists() || values(a).partial_cmp(&values(b)).is_some_and(std::cmp::Ordering::is_gt))
}
