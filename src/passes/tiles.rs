//! Stages 2 to 4 by tiles of the image. The nearest depths, sums and pixels equal those of
//! [`visibility`](super::visibility), [`accumulate`](mod@super::accumulate) and
//! [`resolve`](mod@super::resolve) to the bit.
//!
//! The scatter kernels, with one invocation per splat, add each fragment to memory by atomics. A
//! tile instead has a list of the splats that may touch it, made by count, scan and place. It keeps
//! its pixels' nearest depths, then their sums, in registers. A splat costs, per tile that it
//! touches, about as much as a dozen fragments cost the scatter kernels, so large splats are
//! cheaper by tiles on any adapter. Tiles draw the splats whose bounds hold more than
//! [`LARGE_BY_TILES`](crate::plan::tuning::LARGE_BY_TILES) pixels.
//!
//! On a software adapter, whose atomics are slow, tiles sum all splats (they *gather*) if two
//! conditions hold: splats are not tiny ([`touched`]), and splats that blend with each other are in
//! one page ([`Splats::Tiles`](crate::plan::Splats::Tiles)). A tile then resolves its
//! pixels at once, and no sum is stored. Nearest depths of small splats are always found by the
//! scatter kernels, and all nearest depths are known before any splat is accumulated. Opaque
//! blending within epsilon needs no order, so no list is sorted.
//!
//! The size that the lists need is read from the device once; a later frame that needs more is
//! rendered again.

use std::ops::Range;

use glam::DVec3;

use super::lowpass::Design;
use super::{accumulate, covered, individuals, project};
use crate::gpu::layout::{BLOCK_SIDE, LIST_ENDS, OCCLUSION_TILE, TILE_WIDTH};
use crate::plan::known::Listed;
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Look, Over, Part, Run, Stage, Step};
use crate::plan::{Band, ColorNeed, Facts, Fetch, Plan, SceneNeeds, Settings, tuning};
use crate::scene::{Camera, LowPass, Samples, Surfel};

/// The files and kernels that the tiles' module adds to those of every module.
pub const PASS: Pass = Pass {
    name: "tiles",
    files: |needs| {
        let pick = |needed, file, absent| if needed { file } else { absent };
        let one_sample = needs.samples == Samples::ONE;
        let mut files = vec![
            "bin.wgsl",
            "column.wgsl",
            "tile_reach.wgsl",
            pick(needs.low_pass == LowPass::None, "tile_filter_absent.wgsl", "tile_filter.wgsl"),
            pick(needs.facing.is_some(), "tile_facing.wgsl", pick(needs.curved, "tile_curved.wgsl", "tile_flat.wgsl")),
            pick(needs.surface.gathers(), "tile_small.wgsl", "tile_small_absent.wgsl"),
            match needs.surface.separate() {
                true => "tile_individuals.wgsl",
                false if one_sample => "tile_pixels.wgsl",
                false => pick(staged(needs), "staged_samples.wgsl", "tile_samples.wgsl"),
            },
        ];
        files.extend(accumulate::tile_files(needs));
        match staged(needs) {
            true => files.push("staged.wgsl"),
            false => files.extend([
                "tile.wgsl",
                pick(needs.surface.fetch() == Some(Fetch::Shared), "splat_shared.wgsl", "splat_plain.wgsl"),
                pick(needs.low_pass == LowPass::None, "hand_filter_absent.wgsl", "hand_filter.wgsl"),
                pick(needs.clips, "hand_clip.wgsl", "hand_clip_absent.wgsl"),
                pick(needs.fades, "hand_fade.wgsl", "hand_fade_absent.wgsl"),
                pick(needs.color == ColorNeed::Textured, "hand_texture.wgsl", "hand_plain.wgsl"),
                pick(needs.color == ColorNeed::Textured, "tile_texture.wgsl", "tile_plain.wgsl"),
                pick(
                    needs.facing.is_some(),
                    "hand_facing.wgsl",
                    pick(needs.curved, "hand_curved.wgsl", "hand_flat.wgsl"),
                ),
            ]),
        }
        files
    },
    kernels: |needs| {
        let gathers = needs.surface.gathers();
        let mut kernels = vec![COUNT_LARGE, SCAN_LARGE, PLACE_LARGE, drawing(needs, VISIBILITY)];
        kernels.extend(gathers.then_some([COUNT, SCAN, PLACE]).into_iter().flatten());
        kernels.push(drawing(needs, if gathers { RESOLVE } else { ACCUMULATE }));
        kernels
    },
    constants: |_| Vec::new(),
};

const COUNT_LARGE: Kernel = Kernel::listing("bin_count_large", [8, 8, 1], Listed::Large);
const SCAN_LARGE: Kernel = Kernel::listing("bin_scan_large", [256, 1, 1], Listed::Large);
const PLACE_LARGE: Kernel = Kernel::listing("bin_place_large", [8, 8, 1], Listed::Large);
const COUNT: Kernel = Kernel::listing("bin_count", [64, 1, 1], Listed::Small);
const SCAN: Kernel = Kernel::listing("bin_scan", [256, 1, 1], Listed::Small);
const PLACE: Kernel = Kernel::listing("bin_place", [64, 1, 1], Listed::Small);
const VISIBILITY: &str = "tile_visibility";
const ACCUMULATE: &str = "tile_accumulate";
const RESOLVE: &str = "tile_resolve";

/// The kernel `name`, which draws tiles: eight tiles a workgroup with eight invocations each
/// (`wgsl/tiles/tile.wgsl`), or one tile with an invocation for each pixel
/// (`wgsl/tiles/staged.wgsl`).
fn drawing(needs: &SceneNeeds, name: &'static str) -> Kernel {
    let [width, rows] = STAGED;
    if staged(needs) { Kernel::of(name, [width * rows, 1, 1]) } else { Kernel::new(name) }
}

/// Whether tiles have an invocation for each pixel.
pub fn staged(needs: &SceneNeeds) -> bool {
    needs.surface.fetch() == Some(Fetch::Staged)
}

/// Width and height in pixels of tiles whose invocations share what they fetch. The taller they
/// are, the fewer of them fetch the same splat.
const SHARED: [u32; 2] = [TILE_WIDTH, 16];

/// The same of tiles with an invocation for each pixel.
const STAGED: [u32; 2] = [BLOCK_SIDE; 2];

/// The same of other tiles, and where no tiles are drawn and only the list of covered tiles uses
/// them.
const PLAIN: [u32; 2] = [TILE_WIDTH, OCCLUSION_TILE];

/// The width and height of a tile, pixels.
pub fn size(needs: &SceneNeeds) -> [u32; 2] {
    match needs.surface.fetch() {
        Some(Fetch::Shared) => SHARED,
        Some(Fetch::Staged) => STAGED,
        Some(Fetch::Alone) | None => PLAIN,
    }
}

/// The number of tiles in `band`, of an image of `width` samples.
pub fn tiles_in(needs: &SceneNeeds, width: u32, band: &Band) -> u64 {
    let [across, down] = size(needs);
    u64::from(width.div_ceil(across)) * u64::from(band.rows.div_ceil(down))
}

/// The mean number of tiles of a processor that a splat touches in the view of
/// `camera`, estimated from the sample in `facts`.
///
/// Infinite if the view shows no splat of the sample.
pub fn touched(facts: &Facts, camera: &Camera, options: &Settings) -> f64 {
    let across = |pixels: u32, size: u32| 1.0 + f64::from(pixels.saturating_sub(1)) / f64::from(size);
    let sizes = sampled(facts, camera, options);
    let touched = sizes.map(|[width, height]| across(width, SHARED[0]) * across(height, SHARED[1]));
    let (sum, count) = touched.fold((0.0, 0.0), |(sum, count), tiles| (sum + tiles, count + 1.0));
    if count > 0.0 { sum / count } else { f64::INFINITY }
}

/// The number of pixels that the bounds of all splats have together in the view of `camera`,
/// estimated from the sample in `facts`.
pub fn covered(facts: &Facts, camera: &Camera, options: &Settings) -> f64 {
    let pixels = |[width, height]: [u32; 2]| f64::from(width) * f64::from(height);
    let sum: f64 = sampled(facts, camera, options).map(pixels).sum();
    sum * facts.surfels as f64 / facts.sample.len().max(1) as f64
}

/// Width and height in pixels of the bounds of each splat of the sample in `facts` that the view of
/// `camera` shows.
fn sampled(facts: &Facts, camera: &Camera, options: &Settings) -> impl Iterator<Item = [u32; 2]> {
    let (design, eye) = (Design::of(options), camera.eye - facts.origin);
    let project = move |(surfel, center): &(Surfel, DVec3)| {
        let splat = project::reference((0, surfel, None), *center - eye, camera, &design)?;
        Some([0, 1].map(|axis| splat.last[axis].saturating_sub(splat.first[axis]) + 1))
    };
    facts.sample.iter().filter_map(project)
}

/// Whether a splat of the sample in `facts` is large, so that tiles most likely draw some.
pub fn likely(facts: &Facts, camera: &Camera, (needs, options): (&SceneNeeds, &Settings)) -> bool {
    let most = u64::from(tuning::large(needs.surface.tiles(), options));
    needs.surface.tiles()
        && sampled(facts, camera, options).any(|[width, height]| u64::from(width) * u64::from(height) > most)
}

/// The longest list that tiles draw on software adapters. Mesa's llvmpipe ends the loops of an
/// invocation after 65,535 rounds in total, and the last test of a loop's condition counts as a
/// round. An entry that is fetched alone takes four rounds: one to fetch it, one to draw it, and a
/// last test for each half of the tile. When entries are fetched in eights, eight entries take 19
/// rounds if both halves draw them. A tile has two lists.
pub const LONGEST: u64 = 8_000;

/// Words of the lists of a kind before their entries: the sizes that the frame needs, and the end
/// of each list (`wgsl/tiles/bin.wgsl`).
pub fn list_words(plan: &Plan, of: Listed, band: &Band) -> u64 {
    let cells = match of {
        Listed::Large => u64::from(plan.width.div_ceil(BLOCK_SIDE)) * u64::from(band.rows.div_ceil(BLOCK_SIDE)),
        Listed::Small => tiles_in(&plan.needs, plan.width, band),
    };
    u64::from(LIST_ENDS) + 1 + cells
}

/// The name in WGSL of the buffer of a kind of lists.
pub fn list_name(of: Listed) -> &'static str {
    match of {
        Listed::Large => "large_lists",
        Listed::Small => "small_lists",
    }
}

/// The stage that lists the splats of a page. Without `places`, it only finds how long the lists
/// become.
///
/// With `fresh`, it also resets the sizes that the frame needs.
fn bin(plan: &Plan, of: Listed, (band, page): (usize, usize), fresh: bool, places: bool) -> Stage {
    let most = plan.bands.iter().map(|band| list_words(plan, of, band)).max().unwrap_or(0);
    // The first two words are the sizes that the frame needs.
    let first = if fresh { 0 } else { u64::from(LIST_ENDS) };
    let (kernels, over) = match of {
        Listed::Large => ([COUNT_LARGE, SCAN_LARGE, PLACE_LARGE], Over::Listing),
        Listed::Small => ([COUNT, SCAN, PLACE], Over::Slots(Part::All)),
    };
    let runs = kernels.into_iter().zip([over, Over::Once, over]).map(|(kernel, over)| Run { kernel, over });
    let stage = Stage::new("bin", band, runs.take(if places { 3 } else { 2 }).collect());
    Stage { page: Some(page), ..stage }.after(vec![Clear::of(list_name(of), first, most - first)])
}

/// Counts the entries of all lists of a kind for some pages, in the bands that use the projection
/// of `band`.
pub fn look(plan: &Plan, of: Listed, band: usize, pages: Range<usize>) -> Step {
    let bands = if plan.projects_each_band { band..band + 1 } else { 0..plan.bands.len() };
    let cuts = bands.flat_map(|band| pages.clone().map(move |page| (band, page)));
    let count = |(number, cut)| bin(plan, of, cut, number == 0, false);
    Step::Look(Look::Lists(of, cuts.enumerate().map(count).collect()))
}

/// The visibility pass of the large splats of some pages.
pub fn visibility(plan: &Plan, band: usize, pages: Range<usize>) -> Vec<Stage> {
    let draw = |page| {
        let stage =
            Stage::new("visibility", band, vec![Run { kernel: drawing(&plan.needs, VISIBILITY), over: Over::Tiles }]);
        Stage { page: Some(page), ..stage }
    };
    let fresh = |page| plan.projects_in(band) && page == 0;
    pages.flat_map(|page| [bin(plan, Listed::Large, (band, page), fresh(page), true), draw(page)]).collect()
}

/// The attribute pass of the large splats of some pages.
pub fn accumulate(plan: &Plan, band: usize, pages: Range<usize>) -> Vec<Stage> {
    let draw = |page| {
        let stage =
            Stage::new("accumulate", band, vec![Run { kernel: drawing(&plan.needs, ACCUMULATE), over: Over::Tiles }]);
        Stage { page: Some(page), ..stage }
    };
    // With one page the lists of the first pass are still there in the second.
    let several = pages.len() > 1;
    let again = |page| several.then(|| bin(plan, Listed::Large, (band, page), false, true));
    pages.flat_map(|page| again(page).into_iter().chain([draw(page)])).collect()
}

/// The attribute pass of all splats of a page, which also resolves the sums: to the image, or to
/// the surfaces of a separate input.
pub fn resolve(plan: &Plan, band: usize, page: usize) -> Vec<Stage> {
    let over = if staged(&plan.needs) { Over::Covered } else { Over::CoveredEights };
    let runs = vec![Run { kernel: drawing(&plan.needs, RESOLVE), over }];
    let separate = plan.needs.surface.separate();
    let clear = if separate { individuals::clear(plan, band, page == 0) } else { covered::clear(plan, band) };
    let stage = Stage::new("accumulate", band, runs).of_page(page).after(clear.into_iter().collect());
    vec![bin(plan, Listed::Small, (band, page), page == 0, true), stage]
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::plan::tuning;
    use crate::scene::{Colors, Lens, Scene, Surfel, Up};
    use glam::{DMat3, DVec3, Vec3};

    /// Whether tiles gather a grid of disks of `radius` that fills a unit square, which the camera
    /// sees as 100 x 100 pixels.
    fn gathered(radius: f32) -> bool {
        let at = |i: u32| (i as f32 + 0.5) / 40.0 - 0.5;
        let surfels =
            (0..1600).map(|i| Surfel::disk(Vec3::new(at(i % 40), at(i / 40), 0.0), Vec3::Z, radius)).collect();
        let colors = Colors::Constant([1.0; 4]);
        let scene =
            Scene { origin: DVec3::ZERO, surfels, low: vec![], colors, oriented: true, up: Up::Y, ..Scene::default() };
        let lens = Lens::OrthographicHeight(1.0);
        let camera = Camera::posed((100, 100), lens, DVec3::new(0.0, 0.0, -5.0), DMat3::IDENTITY, 0.1).unwrap();
        touched(&Facts::of(&scene), &camera, &Settings::default()) >= tuning::GATHERED_TOUCHED_TILES
    }

    #[test]
    fn splats_that_touch_two_tiles_each_are_gathered() {
        // A square of n pixels touches (1 + (n - 1) / 8)^2 tiles on average: 2 for n = 4.3.
        assert!(gathered(0.03));
        assert!(!gathered(0.015));
    }
}
