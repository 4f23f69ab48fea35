//! Executes the steps of a frame: binds buffers by name, dispatches kernels, and reads what the
//! device counted.

use super::count::{Capacities, lacks};
use super::exchange::numbers::of_words;
use super::exchange::{Among, Exchange, Onward, Runs, is_of_triangles};
use super::kernels::Kernels;
use super::record::Recording;
use super::store::Store;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::gpu::buffers::{Buffer, Image};
use crate::gpu::kernel::{Grid, grid};
use crate::gpu::layout::{
    COVERED_GRID, COVERED_GRID_OF_EIGHTS, JUDGE_GRID, LIST_FAR, OCCLUSION_BLOCK, OCCLUSION_TILE, QUEUE_GRID,
    QUEUE_LISTING, SPREAD_GRID, TILE_WIDTH, WORKGROUP,
};
use crate::gpu::timing::Timing;
use crate::passes::tiles::{self, list_name};
use crate::passes::{covered, long_lists, raster, resolve, triangles};
use crate::plan::known::{Known, Listed};
use crate::plan::steps::{Clear, Kernel, Look, Over, Part, Stage, Step};
use crate::plan::{Plan, RasterDepth};
use crate::progress::Progress;

/// How many splats a frame has, and whether it is complete.
#[derive(Clone, Copy, Debug)]
pub struct Tally {
    /// Number of splats that may touch a pixel of the image and are not known to be hidden. If each
    /// band has its own splats, a splat counts in every band that draws it.
    pub drawn: u64,
    /// Number of surfels and nodes in the cut, if a cut is drawn.
    pub cut: Option<u64>,
    /// Whether the image is valid. If not, `known` holds the sizes that the next try needs.
    pub complete: bool,
}

/// One try at a frame.
pub struct Run<'a> {
    /// The device.
    pub gpu: &'a Gpu,
    /// The plan of the frame.
    pub plan: &'a Plan,
    /// The kernels of the plan.
    pub kernels: &'a Kernels,
    /// The buffers of scene and frame.
    pub store: &'a mut Store,
    /// Sizes measured so far; this try adds to them.
    pub known: &'a mut Known,
    /// Times by pass.
    pub timing: Timing<'a>,
    /// Where the frame goes if it stays on the device.
    pub(super) recording: Option<Recording<'a>>,
    /// The exchange with other processes that draw the frame.
    pub(super) among: Option<Among<'a>>,
    /// The samples of the present band in which this process has depths, counts or colours of
    /// nearest fragments, for an exchange.
    pub(super) covered: Runs,
    /// Whether an exchange ended the present band, so that it has no image.
    ended: bool,
    /// Whether large splats are drawn by tiles.
    pub(super) by_tiles: bool,
    /// Counts read from the device so far.
    tally: Tally,
    /// Entries that the lists of large and of small splats need, in the band that needs most.
    pub(super) needed: [Option<u64>; 2],
    /// Whether the lists overflowed in some band.
    wanting: bool,
    /// Whether lists cannot hold the large splats of some band.
    pub(super) unlisted: bool,
}

impl<'a> Run<'a> {
    /// Creates a try that has not begun.
    pub fn new(gpu: &'a Gpu, plan: &'a Plan, kernels: &'a Kernels, store: &'a mut Store, known: &'a mut Known) -> Self {
        Self {
            gpu,
            plan,
            kernels,
            store,
            known,
            timing: Timing::new(gpu),
            recording: None,
            among: None,
            covered: Runs::new(),
            ended: false,
            by_tiles: plan.large_by_tiles,
            tally: Tally { drawn: 0, cut: None, complete: true },
            needed: [None; 2],
            wanting: false,
            unlisted: false,
        }
    }

    /// Runs `steps` and appends rows to `frame`. Returns false if buffers are too small for the
    /// rest; `known` then holds the sizes for the next try.
    pub fn steps(&mut self, steps: &[Step], frame: &mut Frame, progress: &dyn Progress) -> Result<bool> {
        for step in steps {
            match step {
                Step::ReadBack(band) if self.ended => {
                    self.ended = false;
                    self.end_band(*band)?;
                    progress.advance(self.plan.bands[*band].rows.into());
                }
                _ if self.ended => {}
                Step::Exchange(what, band) => match self.exchange(*what, *band)? {
                    Onward::Next => {}
                    Onward::EndBand => self.ended = true,
                    Onward::Retry => return Ok(false),
                },
                Step::Stage(stage) if self.is_given(stage) => {}
                Step::Stage(stage) => self.stage(stage)?,
                Step::Large { by_tiles, .. } if self.by_tiles => {
                    by_tiles.iter().try_for_each(|stage| self.stage(stage))?;
                }
                Step::Large { by_workgroups, .. } => by_workgroups.iter().try_for_each(|stage| self.stage(stage))?,
                Step::Draw => self.draw()?,
                Step::DrawTriangles => self.draw_triangles()?,
                Step::ReadBack(band) if self.recording.is_some() => self.record_band(*band)?,
                Step::Look(_) if self.recording.is_some() => {}
                Step::ReadBack(band) => {
                    self.read_back(*band, frame)?;
                    progress.advance(self.plan.bands[*band].rows.into());
                }
                Step::Select => self.select()?,
                Step::Look(Look::Cut) => {
                    self.look_for_cut()?;
                    return Ok(false);
                }
                Step::Look(Look::Slots(part)) => self.look_for_slots(*part)?,
                Step::Look(Look::Fragments(band)) => {
                    if !self.look_for_fragments(*band)? {
                        return Ok(false);
                    }
                }
                Step::Look(Look::Lists(of, stages)) => {
                    if !self.look_for_lists(*of, stages)? {
                        return Ok(false);
                    }
                }
            }
        }
        Ok(true)
    }

    /// Records in `known` what the bands counted, and returns the totals of the frame.
    pub fn tally(&mut self) -> Tally {
        self.learn();
        self.tally
    }

    /// Whether another process gives what `stage` would draw.
    fn is_given(&self, stage: &Stage) -> bool {
        self.among.is_some_and(|among| !among.exchange.draws_triangles()) && is_of_triangles(stage.pass)
    }

    /// Whether the counts of `band` must be read: the next band resets them, or there is none.
    fn counts_in(&self, band: usize) -> bool {
        self.plan.projects_each_band || band + 1 == self.plan.bands.len()
    }

    /// Reads the counts of `band` where no image is read.
    pub fn end_band(&mut self, band: usize) -> Result<()> {
        if !self.counts_in(band) {
            return Ok(());
        }
        let counters = Capacities::of(self.plan, self.store, self.by_tiles).counters(self.store);
        let counted = self.timing.counts(self.gpu, &counters)?;
        self.count(band, &counted);
        Ok(())
    }

    /// Records the list entries of the band that needs most, so that the next try allocates them.
    /// After an overflow nothing is recorded, and the next try measures all bands again.
    pub(super) fn learn(&mut self) {
        for of in [Listed::Large, Listed::Small] {
            let entries = &mut self.known.entries[of as usize];
            *entries = match self.needed[of as usize] {
                _ if self.wanting => None,
                _ if self.unlisted && of == Listed::Large => None,
                Some(needed) => Some(needed.max(entries.unwrap_or(0))),
                None => *entries,
            };
        }
    }

    /// Adds what the counters held at the end of `band` to the tally.
    pub(super) fn count(&mut self, band: usize, counted: &[[u32; 2]]) {
        let counted = Capacities::of(self.plan, self.store, self.by_tiles).compared(counted);
        self.tally.drawn += counted.drawn;
        let mut fits = true;
        if let (Some(rooms), Some(cuts)) = (&self.plan.cut, &counted.cuts) {
            self.tally.cut = Some(cuts.iter().sum());
            fits = self.fits_cut(rooms, cuts);
        }
        // A view has large splats if any of its bands has.
        let before = band > 0 && self.plan.projects_each_band && self.known.large == Some(true);
        self.known.large = Some(before || counted.large);
        let [slots, lists] = [lacks::SLOTS, lacks::LISTS].map(|bit| counted.lacking & bit == 0);
        self.known.slots &= slots;
        self.wanting |= !lists;
        // If splats are missing, this overflow count is not valid.
        if slots && lists && fits {
            self.known.overflows = self.known.overflows.max(counted.overflows);
        }
        self.tally.complete &= slots && lists && fits && counted.overflows == 0;
    }

    pub(super) fn stage(&mut self, stage: &Stage) -> Result<()> {
        let (gpu, plan, store, kernels) = (self.gpu, self.plan, &*self.store, self.kernels);
        let clears = |encoder: &mut wgpu::CommandEncoder| stage.clears.iter().for_each(|c| clear(store, encoder, c));
        self.timing.pass(gpu, stage.pass, clears, |pass| {
            for run in &stage.runs {
                let program = kernels.of(gpu, &run.kernel)?;
                let paged = program.variables(run.kernel.name).iter().any(|(name, _)| Store::is_paged(name));
                let pages = match stage.page {
                    Some(page) => page..page + 1,
                    None if paged => 0..store.pages.len(),
                    None => 0..1,
                };
                for page in pages {
                    let grid = over(gpu, plan, store, (stage.band, page), run.over)?;
                    let binding = |name: &str| binding(store, &run.kernel, name, (stage.band, page));
                    let place = (page, stage.band, run.kernel.lists.map(|of| of as usize));
                    program.dispatch_kept(gpu, pass, run.kernel.name, (&store.groups, place), &binding, grid)?;
                }
            }
            Ok(())
        })
    }

    /// Draws the rasteriser's visibility and attribute passes over the whole image.
    fn draw(&mut self) -> Result<()> {
        let (gpu, plan, store) = (self.gpu, self.plan, &*self.store);
        let (Some(raster), Some(targets)) = (plan.needs.surface.raster(), &store.targets) else { return Ok(()) };
        let program = self.kernels.first(gpu)?;
        let draw = |pass: &mut wgpu::RenderPass<'_>, name| {
            for (number, page) in store.pages.iter().enumerate() {
                let vertices = raster::vertices_of(plan, page.slots);
                let vertices =
                    vertices.ok_or_else(|| gpu.error("a page has too many splats for the rasteriser's vertices"))?;
                let binding = |name: &str| store.binding(name, number, 0);
                program.draw(gpu, pass, name, &binding, vertices)?;
            }
            Ok(())
        };
        let attachment =
            |depth_ops| wgpu::RenderPassDepthStencilAttachment { view: &targets.depth, depth_ops, stencil_ops: None };
        // Empty pixels get the farthest depth.
        let exact = raster.depth == RasterDepth::Exact;
        let nothing = if exact { 1.0 } else { 0.0 };
        let clear = wgpu::Operations { load: wgpu::LoadOp::Clear(nothing), store: wgpu::StoreOp::Store };
        let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store };
        let attach =
            |view| Some(wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops });
        let sums: Vec<_> = targets.sums.iter().map(attach).collect();
        let cleared = Some(attachment(Some(clear)));
        if plan.needs.surface.shows_nearest() {
            return self.timing.draw(gpu, "visibility", &sums, cleared, |pass| draw(pass, "nearest"));
        }
        self.timing.draw(gpu, "visibility", &[], cleared, |pass| draw(pass, "visibility"))?;
        // Without operations the depth buffer is read-only; in exact mode the shader reads it, so
        // it is not attached.
        let depth = (!exact).then(|| attachment(None));
        self.timing.draw(gpu, "accumulate", &sums, depth, |pass| draw(pass, "accumulate"))
    }

    /// Draws the rasteriser's visibility pass of triangles over the whole image. The depth buffer
    /// is cleared again before the splats.
    fn draw_triangles(&mut self) -> Result<()> {
        let (gpu, plan, store) = (self.gpu, self.plan, &*self.store);
        let Some(targets) = &store.targets else { return Ok(()) };
        let program = self.kernels.first(gpu)?;
        let vertices = u32::try_from(3 * plan.mesh.triangles)
            .map_err(|_| gpu.error("there are too many triangles for the rasteriser's vertices"))?;
        let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store };
        let attach = |view| wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops };
        let numbers = [targets.triangles.as_ref().map(attach)];
        let depth_ops = Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard });
        let depth = wgpu::RenderPassDepthStencilAttachment { view: &targets.depth, depth_ops, stencil_ops: None };
        self.timing.draw(gpu, "triangles", &numbers, Some(depth), |pass| {
            let binding = |name: &str| store.binding(name, 0, 0);
            program.draw(gpu, pass, triangles::DRAWN, &binding, vertices)
        })
    }

    /// Reads back the pixels of `band` that this process needs, into a frame of zeros.
    fn read_shown(&mut self, band: usize, frame: &mut Frame, exchange: &dyn Exchange) -> Result<()> {
        self.timing.flush(self.gpu)?;
        let Some(image) = self.store.buffer("image") else { return self.end_band(band) };
        let (layout, words) = (&self.plan.pixel, u64::from(self.plan.pixel.image_words));
        let first = self.first_pixel(band);
        let shown = exchange.shown(first..first + self.plan.image_pixels(band) as usize);
        image.visit_runs(self.gpu, &of_words(&shown, words), |run, pixels| {
            resolve::put(layout, bytemuck::cast_slice(pixels), frame, first + (run.start / words) as usize);
        })?;
        frame.height += self.plan.bands[band].rows / self.plan.needs.samples.down;
        self.end_band(band)
    }

    /// The first pixel of a band in the picture.
    fn first_pixel(&self, band: usize) -> usize {
        (0..band).map(|band| self.plan.image_pixels(band) as usize).sum()
    }

    fn read_back(&mut self, band: usize, frame: &mut Frame) -> Result<()> {
        if let Some(among) = self.among.filter(|among| !among.exchange.shows_all()) {
            return self.read_shown(band, frame, among.exchange);
        }
        let Some((image, readback)) = self.store.image() else { return self.end_band(band) };
        let (layout, pixels) = (&self.plan.pixel, self.plan.image_pixels(band));
        let bytes = pixels * u64::from(layout.image_words) * 4;
        let counts = self.counts_in(band);
        let capacities = counts.then(|| Capacities::of(self.plan, self.store, self.by_tiles));
        let counters = capacities.map_or_else(Vec::new, |capacities| capacities.counters(self.store));
        let piece = &mut |bytes: &[u8]| resolve::unpack(layout, bytes, frame);
        let counted =
            self.timing.read(self.gpu, &counters, Some(Image { readback, buffer: &image.raw, bytes, piece }))?;
        if counts {
            self.count(band, &counted);
        }
        frame.height += self.plan.bands[band].rows / self.plan.needs.samples.down;
        Ok(())
    }

    /// The error after too many tries.
    pub fn never_fits(gpu: &Gpu) -> Error {
        gpu.error("the buffers were too small after every retry of the frame: choose a smaller image")
    }
}

fn clear(store: &Store, encoder: &mut wgpu::CommandEncoder, clear: &Clear) {
    let words = |buffer: &Buffer<u32>, encoder: &mut wgpu::CommandEncoder| {
        encoder.clear_buffer(&buffer.raw, clear.first * 4, clear.count.map(|words| words * 4));
    };
    if Store::is_paged(clear.buffer) {
        store.pages.iter().filter_map(|page| page.buffer(clear.buffer)).for_each(|buffer| words(buffer, encoder));
    } else if let Some(buffer) = store.buffer(clear.buffer) {
        words(buffer, encoder);
    }
}

/// The binding of a variable of `kernel`.
fn binding<'a>(
    store: &'a Store,
    kernel: &Kernel,
    name: &str,
    (band, page): (usize, usize),
) -> Option<wgpu::BindingResource<'a>> {
    let name = match kernel.lists {
        Some(lists) if name == "lists" => list_name(lists),
        _ => name,
    };
    store.binding(name, page, band)
}

/// Returns the workgroups of a dispatch, from the plan or from a buffer that the device fills.
pub(super) fn over<'a>(
    gpu: &Gpu,
    plan: &Plan,
    store: &'a Store,
    (band, page): (usize, usize),
    over: Over,
) -> Result<Grid<'a>> {
    let of_page = store.pages.get(page);
    let missing = || gpu.error("a stage needs a buffer that does not exist");
    let counted = |buffer: Option<&'a Buffer<u32>>, word: u64| {
        buffer.map(|buffer| Grid::In(&buffer.raw, word * 4)).ok_or_else(missing)
    };
    let queue = || of_page.and_then(|page| page.buffer("queue"));
    let covered = |grid: u32| counted(store.buffer("nearest"), covered::start(plan, band) + u64::from(grid));
    let invocations = match over {
        Over::Slots(part) if plan.needs.cull => {
            let word = if part == Part::Far { LIST_FAR } else { 0 };
            return counted(of_page.and_then(|page| page.buffer("drawn")), word.into());
        }
        Over::Judged => return counted(store.buffer("selection"), JUDGE_GRID.into()),
        Over::Spread => return counted(store.buffer("selection"), SPREAD_GRID.into()),
        Over::Rare => return counted(of_page.and_then(|page| page.buffer("rare")), QUEUE_GRID.into()),
        Over::Large => return counted(queue(), QUEUE_GRID.into()),
        Over::LargeTriangles => return counted(store.buffer("large_triangles"), QUEUE_GRID.into()),
        Over::TriangleTiles => return counted(store.buffer("triangle_tiles"), 1),
        Over::RareTriangles => return counted(store.buffer("rare_triangles"), QUEUE_GRID.into()),
        Over::Listing => return counted(queue(), QUEUE_LISTING.into()),
        Over::Covered => return covered(COVERED_GRID),
        Over::CoveredEights => return covered(COVERED_GRID_OF_EIGHTS),
        Over::Once => return Ok(Grid::Of((1, 1))),
        Over::Slots(_) => of_page.map_or(0, |page| page.slots),
        Over::Batches => of_page.map_or(0, |page| page.batches()),
        Over::Occlusion => plan.bands[band].tiles,
        Over::OcclusionBlocks => {
            let blocks = |side: u32| u64::from(side.div_ceil(OCCLUSION_BLOCK * OCCLUSION_TILE));
            blocks(plan.width) * blocks(plan.bands[band].rows) * u64::from(WORKGROUP)
        }
        Over::Vertices => plan.mesh.vertices,
        Over::Triangles => plan.mesh.triangles,
        Over::Rows => plan.bands[band].rows.into(),
        Over::Pixels => plan.bands[band].pixels,
        Over::LongLists => store.buffer("long_lists").map_or(0, |kept| long_lists::room(kept.len)),
        Over::Tiles => {
            let each = if tiles::staged(&plan.needs) { WORKGROUP } else { TILE_WIDTH };
            tiles::tiles_in(&plan.needs, plan.width, &plan.bands[band]) * u64::from(each)
        }
    };
    Ok(Grid::Of(grid(gpu, invocations)?))
}
