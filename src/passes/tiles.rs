//! Stages 2 to 4 by tiles of the image: the same minima, sums and pixels as [`visibility`](super::visibility),
//! [`accumulate`](super::accumulate) and [`resolve`](super::resolve) make, to the bit.
//!
//! Scatter, an invocation a splat, adds each fragment to memory by atomics. A tile has a list of the splats that may touch it,
//! made by count, scan and place, and keeps its pixels' nearest depths, and then their sums, in registers. A splat costs each
//! tile that it touches about as much as a dozen of scatter's fragments, so large splats are cheaper by tiles on any adapter:
//! those whose bounds hold more than [`LARGE_BY_TILES`](crate::gpu::layout::LARGE_BY_TILES) pixels are. On a software adapter,
//! whose atomics are slow, all splats are summed so if they are not tiny ([`gathers`]), have one page, and the image has one
//! band ([`SceneNeeds::gather`](crate::plan::SceneNeeds::gather)): then a tile resolves its pixels at once, and no sum is
//! stored. Nearest depths of small splats are found by scatter in any case, and all splats share the nearest depths before any
//! is accumulated. Opaque blending within epsilon does not ask for an order, so no list is sorted.
//!
//! What room the lists need is read from the device once; a later frame that needs more is rendered again.

use std::sync::Arc;

use super::accumulate::AttributeBuffer;
use super::cull::Part;
use super::lowpass::Design;
use super::project::{self, SplatBuffer};
use super::resolve::ImageBuffer;
use super::variant::tile_rows;
use super::visibility::VisibilityBuffer;
use super::{Recorder, Rows};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::{Buffer, counts};
use crate::gpu::kernel::{Bound, Grid, Program, grid};
use crate::gpu::layout::{BLOCK_SIDE, LIST_ENDS, QUEUE_LISTING, TILE_ROWS_SHARED, TILE_WIDTH};
use crate::plan::{RenderOptions, SceneNeeds};
use crate::scene::{Camera, Scene};

/// The fewest tiles that a splat touches on average for all to be summed by tiles. On a software adapter at 1024x1024 frames
/// of 1,000,000 splats that touch 1.4, 1.9 and 2.2 tiles, and of 300,000 that touch 2.8, take 1.5, 1.1, 0.96 and 0.82 times as
/// long by tiles as by scatter.
const TOUCHED_TILES: f64 = 2.0;

/// Surfels that are looked at for it.
const SAMPLED: usize = 1024;

/// Whether tiles should sum all splats of the scene, on an adapter where large ones gain much by it.
pub fn gathers(scene: &Scene, camera: &Camera, options: &RenderOptions) -> bool {
    let design = Design::of(options);
    let step = scene.surfels.len().div_ceil(SAMPLED).max(1);
    let eye = camera.eye - scene.origin;
    let sampled = scene.surfels.iter().enumerate().step_by(step);
    let splats = sampled
        .filter_map(|(index, surfel)| project::reference((0, surfel), scene.center(index) - eye, camera, &design));
    let across = |first: u32, last: u32, size: u32| 1.0 + f64::from(last.saturating_sub(first)) / f64::from(size);
    let touched = splats.map(|splat| {
        let ([left, top], [right, bottom]) = (splat.first, splat.last);
        across(left, right, TILE_WIDTH) * across(top, bottom, TILE_ROWS_SHARED)
    });
    let (sum, count) = touched.fold((0.0, 0.0), |(sum, count), tiles| (sum + tiles, count + 1.0));
    sum >= TOUCHED_TILES * count
}

/// The tiles of an image.
pub struct Tiles {
    program: Arc<Program>,
    /// Columns of the image.
    width: u32,
    /// Rows of a tile.
    rows: u32,
    large: Lists,
    small: Lists,
}

/// Lists of the splats that may touch each cell of the image.
struct Lists {
    /// What the frame needed, where each list ends, and the lists (`wgsl/bin.wgsl`).
    words: Buffer<u32>,
    /// Entries that there is room for.
    entries: u64,
}

/// Which splats are listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Listed {
    /// The large ones, by blocks of tiles.
    Large,
    /// The small ones that are not hidden, by tiles.
    Small,
}

impl Listed {
    /// Pixels of a cell, across and down, where tiles have `rows`.
    fn cell(self, rows: u32) -> [u32; 2] {
        match self {
            Self::Large => [BLOCK_SIDE; 2],
            Self::Small => [TILE_WIDTH, rows],
        }
    }
}

/// What the lists of a page and band hold at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Room {
    /// Entries of all lists.
    entries: u64,
    /// Entries of the longest list.
    longest: u64,
}

/// The longest list that is drawn. Mesa's llvmpipe ends the loops of an invocation after 65,535 rounds in all, of which the last
/// look at a condition is one. An entry that is fetched alone takes four: to be fetched, to be drawn, and a last look for each half
/// of the tile; of those fetched in eights, eight take 19, if both halves draw them. There are two lists.
const LONGEST: u64 = 8_000;

impl Room {
    /// What a page and band needed at most in a frame, as the first words of its lists say.
    fn needed([entries, longest]: [u32; 2]) -> Self {
        Self { entries: entries.into(), longest: longest.into() }
    }

    /// Whether this is enough for `needed`.
    fn holds(self, needed: Self) -> bool {
        needed.entries <= self.entries && needed.longest <= self.longest
    }
}

impl Lists {
    /// Lists of cells of `cell` pixels, across and down, with room for `entries`.
    fn new(gpu: &Gpu, cell: [u32; 2], (width, bands): (u32, &[Rows]), entries: u64) -> Result<Self> {
        let cells = |rows: &Rows| u64::from(width.div_ceil(cell[0])) * u64::from(rows.count.div_ceil(cell[1]));
        let most = bands.iter().map(cells).max().unwrap_or(0);
        let words = Buffer::storage(gpu, "lists of splats", u64::from(LIST_ENDS) + 1 + most + entries)?;
        Ok(Self { words, entries })
    }
}

impl Tiles {
    /// Tiles for each of `bands` of an image of `width` columns, drawn by `program`. They have no room yet.
    pub fn new(gpu: &Gpu, (program, needs): (Arc<Program>, &SceneNeeds), image: (u32, &[Rows])) -> Result<Self> {
        let rows = tile_rows(needs);
        let [large, small] = [Listed::Large, Listed::Small].map(|of| Lists::new(gpu, of.cell(rows), image, 0));
        Ok(Self { program, width: image.0, rows, large: large?, small: small? })
    }

    /// Makes room for the splats that are projected now, and a quarter more for the next view; false if there are more than a
    /// binding or a list holds.
    pub fn make_room(
        &mut self,
        recorder: &mut Recorder<'_>,
        of: Listed,
        splats: &SplatBuffer,
        bands: &[Rows],
        visible: &VisibilityBuffer,
    ) -> Result<bool> {
        let gpu = recorder.gpu;
        for rows in bands {
            for page in 0..splats.pages.len() {
                let fresh = rows.first == 0 && page == 0;
                self.bin(recorder, of, (splats, page), (rows, visible), fresh, false)?;
            }
        }
        let needed = counts(gpu, &[&self.lists(of).words])?.into_iter().next().unwrap_or_default();
        let needed = Room::needed(needed);
        let room = Room { entries: needed.entries + needed.entries / 4, longest: needed.longest };
        // These have no entries yet: what they are long is what precedes the entries.
        let before = self.lists(of).words.len;
        let most = Room { entries: (gpu.buffer_limit() / 4).saturating_sub(before), longest: LONGEST };
        if !most.holds(room) {
            return Ok(false);
        }
        let lists = Lists::new(gpu, of.cell(self.rows), (self.width, bands), room.entries)?;
        match of {
            Listed::Large => self.large = lists,
            Listed::Small => self.small = lists,
        }
        Ok(true)
    }

    /// The same for another variant of the kernels.
    pub(crate) fn of_variant(self, program: Arc<Program>) -> Self {
        Self { program, ..self }
    }

    /// Device memory that they take, bytes.
    pub fn bytes(&self) -> u64 {
        self.large.words.bytes() + self.small.words.bytes()
    }

    /// What says how much room a frame needed.
    pub(crate) fn counters(&self) -> [&Buffer<u32>; 2] {
        [&self.large.words, &self.small.words]
    }

    /// Whether there was room for the frame by what they say, the first of `counted`; if not, the image is wrong.
    pub(crate) fn held(&self, counted: &mut impl Iterator<Item = [u32; 2]>) -> bool {
        [&self.large, &self.small]
            .into_iter()
            .zip(counted)
            .all(|(lists, needed)| Room { entries: lists.entries, longest: LONGEST }.holds(Room::needed(needed)))
    }

    fn lists(&self, of: Listed) -> &Lists {
        match of {
            Listed::Large => &self.large,
            Listed::Small => &self.small,
        }
    }

    /// What the kernels bind of a page, beside `buffers`.
    fn bindings<'a>(
        &'a self,
        recorder: &Recorder<'a>,
        (splats, page): (&'a SplatBuffer, usize),
        rows: &'a Rows,
        buffers: &[(&'a str, wgpu::BindingResource<'a>)],
    ) -> Bound<'a> {
        let own = [("view", recorder.view.bound()), ("band", rows.uniform.bound())];
        splats.bindings(page, &own.into_iter().chain(buffers.iter().cloned()).collect::<Vec<_>>())
    }

    /// Records lists of a page's splats; only their lengths unless it `places` them. What the frame needs is not known yet if it
    /// is `fresh`.
    fn bin(
        &self,
        recorder: &mut Recorder<'_>,
        of: Listed,
        (splats, page): (&SplatBuffer, usize),
        (rows, visible): (&Rows, &VisibilityBuffer),
        fresh: bool,
        places: bool,
    ) -> Result<()> {
        let (gpu, culled, lists) = (recorder.gpu, recorder.variant.needs.cull, self.lists(of));
        // The first two words are what it needs.
        let first = if fresh { 0 } else { u64::from(LIST_ENDS) };
        let words = lists.words.len - lists.entries - first;
        let clear =
            |encoder: &mut wgpu::CommandEncoder| encoder.clear_buffer(&lists.words.raw, first * 4, Some(words * 4));
        let own = [
            ("lists", lists.words.bound()),
            ("splats", splats.pages[page].splats.bound()),
            ("visible", visible.nearest.bound()),
        ];
        let bound = self.bindings(recorder, (splats, page), rows, &own);
        let page = &splats.pages[page];
        let [count, scan, place] = match of {
            Listed::Large => ["bin_count_large", "bin_scan_large", "bin_place_large"],
            Listed::Small => ["bin_count", "bin_scan", "bin_place"],
        };
        let list = |pass: &mut wgpu::ComputePass<'_>, kernel| {
            if of == Listed::Large {
                let grid = Grid::In(&page.queue.raw, u64::from(QUEUE_LISTING) * 4);
                return self.program.dispatch(gpu, pass, kernel, &bound, grid);
            }
            let (slots, drawn) = page.of(gpu, Part::All, culled)?;
            let bound: Bound<'_> = bound.iter().cloned().chain(drawn).collect();
            self.program.dispatch(gpu, pass, kernel, &bound, slots)
        };
        recorder.timing.pass(gpu, "bin", clear, |pass| {
            list(pass, count)?;
            self.program.dispatch(gpu, pass, scan, &bound, Grid::Of((1, 1)))?;
            if places { list(pass, place) } else { Ok(()) }
        })
    }

    /// What the kernels of tiles bind for the splats of a page, beside `buffers`.
    fn listed<'a>(
        &'a self,
        recorder: &Recorder<'a>,
        page: (&'a SplatBuffer, usize),
        rows: &'a Rows,
        buffers: &[(&'a str, wgpu::BindingResource<'a>)],
    ) -> Bound<'a> {
        let mut own = vec![("large_lists", self.large.words.bound()), ("small_lists", self.small.words.bound())];
        own.extend_from_slice(buffers);
        self.bindings(recorder, page, rows, &own)
    }

    /// Records `kernel` over the tiles of `rows`, for the splats of a page, as a part of `stage`.
    fn draw(
        &self,
        recorder: &mut Recorder<'_>,
        (stage, kernel): (&'static str, &'static str),
        page: (&SplatBuffer, usize),
        rows: &Rows,
        buffers: &[(&str, wgpu::BindingResource<'_>)],
    ) -> Result<()> {
        let gpu = recorder.gpu;
        let tiles = u64::from(self.width.div_ceil(TILE_WIDTH)) * u64::from(rows.count.div_ceil(self.rows));
        let bound = self.listed(recorder, page, rows, buffers);
        let groups = Grid::Of(grid(gpu, tiles * u64::from(TILE_WIDTH))?);
        let kernel = |pass: &mut wgpu::ComputePass<'_>| self.program.dispatch(gpu, pass, kernel, &bound, groups);
        recorder.timing.pass(gpu, stage, |_| {}, kernel)
    }
}

/// Records the visibility pass of the large splats over `rows`.
pub fn visibility(
    recorder: &mut Recorder<'_>,
    splats: &SplatBuffer,
    rows: &Rows,
    tiles: &Tiles,
    buffer: &VisibilityBuffer,
) -> Result<()> {
    for page in 0..splats.pages.len() {
        let fresh = rows.first == 0 && page == 0;
        tiles.bin(recorder, Listed::Large, (splats, page), (rows, buffer), fresh, true)?;
        let buffers = [("nearest", buffer.nearest.bound())];
        tiles.draw(recorder, ("visibility", "tile_visibility"), (splats, page), rows, &buffers)?;
    }
    Ok(())
}

/// Records the attribute pass of the large splats over `rows`.
pub fn accumulate(
    recorder: &mut Recorder<'_>,
    splats: &SplatBuffer,
    rows: &Rows,
    tiles: &Tiles,
    (visible, buffer): (&VisibilityBuffer, &AttributeBuffer),
) -> Result<()> {
    for page in 0..splats.pages.len() {
        // Of one page the lists stay from the first pass to the second.
        if splats.pages.len() > 1 {
            tiles.bin(recorder, Listed::Large, (splats, page), (rows, visible), false, true)?;
        }
        let stages = ("accumulate", "tile_accumulate");
        tiles.draw(recorder, stages, (splats, page), rows, &buffer.bindings(visible))?;
    }
    Ok(())
}

/// Records the attribute pass of all splats, which are of one page, over `rows`, and what becomes of the sums.
pub fn resolve(
    recorder: &mut Recorder<'_>,
    splats: &SplatBuffer,
    rows: &Rows,
    tiles: &Tiles,
    (visible, buffer): (&VisibilityBuffer, &ImageBuffer),
) -> Result<()> {
    tiles.bin(recorder, Listed::Small, (splats, 0), (rows, visible), true, true)?;
    let (gpu, program, variant) = (recorder.gpu, recorder.program, recorder.variant);
    let covered = visible.covered(rows);
    let buffers = [("visible", visible.nearest.bound()), ("image", buffer.image.bound())];
    let bound = tiles.listed(recorder, (splats, 0), rows, &buffers);
    let clear = |encoder: &mut wgpu::CommandEncoder| buffer.clear(variant, encoder, rows, covered);
    recorder.timing.pass(gpu, "accumulate", clear, |pass| {
        covered.record((gpu, program), pass, rows, &bound)?;
        tiles.program.dispatch(gpu, pass, "tile_resolve", &bound, covered.eights())
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::scene::{Colors, Lens, Surfel, Up};
    use glam::{DMat3, DVec3, Vec3};

    /// A grid of disks of `radius` that faces a camera which sees its unit square in 100 pixels squared.
    fn gathered(radius: f32) -> bool {
        let at = |i: u32| (i as f32 + 0.5) / 40.0 - 0.5;
        let surfels =
            (0..1600).map(|i| Surfel::disk(Vec3::new(at(i % 40), at(i / 40), 0.0), Vec3::Z, radius)).collect();
        let colors = Colors::Constant([1.0; 4]);
        let scene = Scene { origin: DVec3::ZERO, surfels, low: vec![], colors, oriented: true, up: Up::Y };
        let lens = Lens::OrthographicHeight(1.0);
        let camera = Camera::posed((100, 100), lens, DVec3::new(0.0, 0.0, -5.0), DMat3::IDENTITY, 0.1).unwrap();
        gathers(&scene, &camera, &RenderOptions::default())
    }

    #[test]
    fn splats_that_touch_two_tiles_each_are_gathered() {
        // A square of n pixels touches (1 + (n - 1) / 8)^2 tiles on average, 2 where n is 4.3.
        assert!(gathered(0.03));
        assert!(!gathered(0.015));
    }
}
