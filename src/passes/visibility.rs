//! Stage 2: the nearest depth at every pixel, `min z` over the splats that cover it (paper 000,
//! section 5.3, first pass). The paper adds the tolerance to the depths. Here the tolerance enters
//! the comparison, which is exact.
//!
//! On the device depths are positive f32, whose bits order as u32, so an atomic minimum would work.
//! Depths are stored as `bits(+inf) - bits(depth)`: then the minimum is an atomic maximum, and a
//! buffer of zeros is empty. The farthest of the nearest depths in each tile of pixels lets the
//! next pass skip splats that are hidden completely. Where surfels have sides and both may be seen,
//! the last bit of a depth stores the side (side.wgsl).

use super::footprint::footprint;
use super::splat::Splat;
use super::{covered, oit, winner};
use crate::gpu::layout::{COVERED_LIST, TILE};
use crate::plan::extra::{self, EXTRA};
use crate::plan::pass::Pass;
use crate::plan::steps::{Clear, Kernel, Over, Part, Run, Stage, Twin};
use crate::plan::{Band, Oit, Optimisation, Plan, Surface, Winner};
use crate::scene::{Camera, LowPass};

/// The nearest fragment of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Camera-space z, world units; +inf in an empty pixel.
    pub depth: f64,
    /// Whether it shows the back of a two-sided surface ([`Splat::shows_back`]). If a front and a
    /// back have the same depth, the front is nearest.
    pub back: bool,
}

impl Nearest {
    /// An empty pixel.
    pub const NOTHING: Self = Self { depth: f64::INFINITY, back: false };

    /// The nearest of this and another fragment.
    pub fn with(self, depth: f64, back: bool) -> Self {
        let nearer = depth < self.depth || (depth == self.depth && !back);
        if nearer { Self { depth, back } } else { self }
    }

    /// Whether a fragment belongs to this surface: its depth is at most `behind`, the far end of
    /// the tolerance, and it shows the same side.
    pub fn shows(self, depth: f64, back: bool, behind: f64) -> bool {
        depth <= behind && back == self.back
    }
}

/// The f64 twin: the nearest fragments in the rows `first_row..first_row + rows`.
pub fn reference<'a>(
    splats: impl Iterator<Item = &'a Splat>,
    camera: &Camera,
    low_pass: LowPass,
    first_row: u32,
    rows: u32,
) -> Vec<Nearest> {
    let mut nearest = vec![Nearest::NOTHING; camera.width as usize * rows as usize];
    for splat in splats {
        for y in splat.first[1].max(first_row)..=splat.last[1].min(first_row + rows - 1) {
            let row = (y - first_row) as usize * camera.width as usize;
            for x in splat.first[0]..=splat.last[0] {
                let hit = footprint(splat, camera, low_pass, x, y).filter(|(at, _)| at.hit(camera));
                if let Some((hit, _)) = hit.filter(|_| splat.fade.takes(x, y)) {
                    let pixel = &mut nearest[row + x as usize];
                    *pixel = pixel.with(hit.depth, splat.shows_back(&hit));
                }
            }
        }
    }
    nearest
}

/// The pass's kernels, files and constants.
pub const PASS: Pass = Pass {
    name: "visibility",
    files: |needs| {
        let nearest = match needs.surface {
            // The rasteriser has a depth buffer.
            Surface::Raster { .. } => return Vec::new(),
            // Moments and lists store something else in place of nearest depths.
            Surface::OrderFree(Oit::Moments) | Surface::Layers { .. } | Surface::Sorted { .. } => None,
            Surface::Nearest(Winner::Once) => Some("nearest_color.wgsl"),
            Surface::Blended { .. } | Surface::OrderFree(Oit::Weighted) | Surface::Nearest(_) => {
                Some("nearest_depth.wgsl")
            }
        };
        ["visibility.wgsl", "occlusion.wgsl", "front.wgsl"].into_iter().chain(nearest).collect()
    },
    kernels: |needs| match (needs.surface.raster(), needs.cull) {
        (None, false) if oit::marks(needs) => vec![OCCLUDE],
        (None, culls) => {
            let small = (!needs.draws_projected).then_some(VISIBILITY);
            small.into_iter().chain([VISIBILITY_LARGE, OCCLUDE]).chain(culls.then_some(OCCLUDE_OPEN)).collect()
        }
        (Some(_), _) => Vec::new(),
    },
    constants: |making| {
        // Fragments that are all summed (order-independent transparency) do not hide each other.
        let hides = making.options.has(Optimisation::Hiding) && making.needs.surface.oit().is_none();
        vec![("HIDES", u32::from(hides).into())]
    },
};

const VISIBILITY: Kernel = Kernel::new("visibility");
const VISIBILITY_LARGE: Kernel = Kernel::of("visibility_large", [TILE, TILE, 1]);
const OCCLUDE: Kernel = Kernel::new("occlude");
const OCCLUDE_OPEN: Kernel = Kernel::new("occlude_open");

/// Words of the buffer of nearest depths: one per pixel, one per tile (occlusion.wgsl), then the
/// list of covered tiles.
pub fn nearest_words(band: &Band) -> u64 {
    band.pixels + band.tiles + covered::words(band)
}

/// The clears before the first splats of a band are drawn.
pub fn clears(plan: &Plan, band: usize) -> impl Iterator<Item = Clear> {
    // Pixels, occlusion tiles and the header of the list of covered tiles are neighbours.
    let nearest = Clear::of("nearest", 0, covered::start(plan, band) + u64::from(COVERED_LIST));
    let summed = EXTRA.iter().filter(|extra| extra.summed);
    let summed = summed.filter_map(move |extra| extra::clear(extra.name, plan, band));
    [nearest].into_iter().chain(winner::clears(plan, band)).chain(summed)
}

/// The stage that draws `part` of the small splats; `None` if [`project`](super::project) does.
pub fn steps(plan: &Plan, band: usize, part: Part) -> Option<Stage> {
    let stage = Stage::new("visibility", band, vec![Run { kernel: VISIBILITY, over: Over::Slots(part) }]);
    let stage = match part {
        Part::Far => stage,
        Part::All | Part::Near => stage.after(clears(plan, band).collect()).as_twin(Twin::Visibility),
    };
    (!plan.needs.draws_projected).then_some(stage)
}

/// The stage that draws the large splats, one workgroup each.
pub fn large(band: usize) -> Stage {
    Stage::new("visibility", band, vec![Run { kernel: VISIBILITY_LARGE, over: Over::Large }])
}

/// The stage that stores the farthest of the nearest depths in each tile and, after
/// [`Part::All`], lists the tiles that are not empty ([`covered`]).
///
/// After [`Part::Near`], a tile with an empty pixel hides nothing, since far splats may still fill
/// that pixel.
pub fn occlude(band: usize, part: Part) -> Stage {
    let run = match part {
        Part::Near => Run { kernel: OCCLUDE_OPEN, over: Over::Occlusion },
        Part::All | Part::Far => Run { kernel: OCCLUDE, over: Over::OcclusionBlocks },
    };
    Stage::new("visibility", band, vec![run])
}
