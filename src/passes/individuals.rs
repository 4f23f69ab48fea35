//! Stages 2 to 4 where inputs are kept apart: Tien's individuals (2008, chapter 5), which do not blend however near they are.
//!
//! Each is blended by itself, its nearest depths and its sums in the buffers that all share, and its pixels are shaded; of what they show
//! the nearest is kept, by the depth that each blends to, as triangles and splats are told apart ([`join`](super::join)). So any number of
//! them may meet at a pixel. A picture costs what its inputs would one by one, and eight words a pixel, or sixteen where maps or triangles ask
//! for more.

use super::resolve::Surface;
use super::{Strip, accumulate, covered, resolve, visibility};
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Run, Stage};
use crate::plan::{Plan, SceneNeeds};

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "individuals",
    files: |needs| match needs.separate {
        true => vec!["individuals.wgsl"],
        // What shows through is made of lists.
        false if needs.lists.is_some() || needs.peels.is_some() => Vec::new(),
        false => vec!["individuals_absent.wgsl"],
    },
    kernels: |needs| if needs.separate { vec![KEEP, LIST] } else { Vec::new() },
    constants: |making| vec![("INDIVIDUAL_VECTORS", (words(making.needs) / 4).into())],
};

const KEEP: Kernel = Kernel::new("keep_individual");
const LIST: Kernel = Kernel::new("list_individuals");

/// Words of what individuals show at a pixel.
pub fn words(needs: &SceneNeeds) -> u32 {
    match needs.separate {
        false => 0,
        true if needs.maps.is_empty() && needs.mesh.is_none() => 8,
        true => 16,
    }
}

/// What lists the tiles in which any shows.
pub const LISTS: Run = Run { kernel: LIST, over: Over::Occlusion };

/// What an individual shows, where it is nearest, of the sums that are stored.
pub fn keep(plan: &Plan, band: usize, first: bool) -> Stage {
    let mut runs = covered::runs(covered::LISTS).to_vec();
    runs.push(Run { kernel: KEEP, over: Over::Covered });
    Stage::new("resolve", band, runs).after(clears(plan, band, first))
}

/// What is cleared before an individual's tiles are listed; before the `first` one nothing is kept.
pub fn clears(plan: &Plan, band: usize, first: bool) -> Vec<Clear> {
    let words = plan.bands[band].pixels * u64::from(words(&plan.needs));
    let kept = first.then(|| Clear::of("individuals", 0, words));
    [covered::restart(plan, band)].into_iter().chain(kept).collect()
}

/// The twin: what an individual shows at the pixels of `strip`.
pub fn reference(strip: &Strip<'_>, individual: usize) -> Vec<Surface> {
    let Strip { scene, camera, options, first_row, rows, .. } = *strip;
    let own = scene.provenance.ranges(scene.surfels.len() as u64).nth(individual).unwrap_or(0..0);
    let splats = || strip.splats.iter().copied().filter(|splat| own.contains(&splat.surfel.into()));
    let nearest = visibility::reference(splats(), camera, options.low_pass, first_row, rows);
    let sums = accumulate::reference(splats(), scene, camera, options, first_row, &nearest);
    resolve::surfaces(&sums, &nearest, (scene, camera, options), first_row)
}

/// The twin: of what is `kept` and what another individual shows the nearer, and what lies near a decision.
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

/// Whether `a` shows instead of `b`: it is nearer, or at one depth has the greater of the first of its values that differs.
fn shows_before(a: &Surface, b: &Surface) -> bool {
    let values = |of: &Surface| {
        let [x, y, z] = of.normal.to_array();
        let [red, green, blue, alpha] = of.color;
        let [u, v] = of.place;
        [-of.depth, red, green, blue, alpha, x, y, z, of.weight, u, v, of.count.into(), of.front]
    };
    a.exists() && (!b.exists() || values(a).partial_cmp(&values(b)).is_some_and(std::cmp::Ordering::is_gt))
}
