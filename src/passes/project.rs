//! Stage 1: every surfel becomes a splat, once: its [`homography`], the pixels that it may touch, and its
//! [`lowpass`].
//!
//! Bounds only save work: [`footprint`](super::footprint) decides.

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::cull::{Batches, Part};
use super::homography::{self, slope};
use super::lowpass::{self, Design, Filter};
use super::upload::SurfelBuffer;
use super::{Recorder, Rows};
use crate::error::Result;
use crate::gpu::buffers::{Buffer, counts};
use crate::gpu::kernel::{Bound, Grid, grid};
use crate::gpu::{Gpu, layout};
use crate::plan::RenderOptions;
use crate::scene::{Camera, LowPass, Scene, Surfel, copies, has_copies};

/// A projected surfel in f64: the twin of [`layout::Splat`], in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// Which surfel it was.
    pub surfel: u32,
    /// The pixel that the rows are relative to.
    pub anchor: [i64; 2],
    /// First pixel (x, y) that the splat may touch.
    pub first: [u32; 2],
    /// Last pixel.
    pub last: [u32; 2],
    /// `a . (dx, dy, 1)` is u/z (pinhole) or u (orthographic).
    pub a: DVec3,
    /// The same for v.
    pub b: DVec3,
    /// 1/z (pinhole) or z (orthographic).
    pub c: DVec3,
    /// The normal points away from the viewer.
    pub away: bool,
    /// World space, unit, as the surfel has it.
    pub normal: DVec3,
    /// The low-pass, if there is one.
    pub filter: Option<Filter>,
    /// Surfels that it stands for.
    pub copies: u32,
}

/// The twin of `wgsl/project.wgsl` for one surfel, whose centre is at `relative` (world units) from the camera's eye; `None` if no
/// pixel can be touched.
pub fn reference(of: (u32, &Surfel), relative: DVec3, camera: &Camera, design: &Design) -> Option<Splat> {
    projected(of, relative, camera, design).ok()
}

/// Why a surfel touches no pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Missed {
    /// It lies behind the camera, or nearer than the near depth.
    Behind,
    /// It lies beside the image.
    Outside,
    /// It lies between the centres of pixels: it is small, or seen edge-on.
    Between,
}

/// The splat of [`reference`], or why there is none.
pub(super) fn projected(
    (index, surfel): (u32, &Surfel),
    relative: DVec3,
    camera: &Camera,
    design: &Design,
) -> Result<Splat, Missed> {
    let vector = |v: [f32; 3]| Vec3::from_array(v).as_dvec3();
    let (s_world, t_world) = (vector(surfel.s), vector(surfel.t));
    let (p, s, t) = (camera.rotation * relative, camera.rotation * s_world, camera.rotation * t_world);
    if p.z + slope(s, t) < camera.near {
        return Err(Missed::Behind);
    }
    let mut projected = homography::projected(camera, p, s, t);
    let near = (p.z - slope(s, t)).max(camera.near);
    let depths = [near, (p.z + slope(s, t)).max(near)];
    let filter = projected.images.and_then(|[center, s, t]| lowpass::filter(design, center, s, t, depths));
    if let Some(filter) = &filter {
        let center = DVec2::new(projected.anchor[0] as f64, projected.anchor[1] as f64) + 0.5 + filter.center;
        let (low, high) = (center - filter.extent, center + filter.extent);
        // The disk itself shows only beside the filter of `max`.
        let beside = design.low_pass == LowPass::Max;
        projected.low = if beside { projected.low.min(low) } else { low };
        projected.high = if beside { projected.high.max(high) } else { high };
    }
    let margin = 0.01 + 1e-5 * (projected.low.abs() + projected.high.abs());
    let size = DVec2::new(camera.width.into(), camera.height.into());
    let first = (projected.low - margin - 0.5).ceil().max(DVec2::ZERO);
    let last = (projected.high + margin - 0.5).floor().min(size - 1.0);
    if !(first.x <= last.x && first.y <= last.y) {
        let in_image = projected.low.cmplt(size).all() && projected.high.cmpgt(DVec2::ZERO).all();
        return Err(if in_image { Missed::Between } else { Missed::Outside });
    }
    let normal = s_world.cross(t_world);
    let normal = (normal / normal.abs().max_element()).normalize();
    Ok(Splat {
        surfel: index,
        anchor: projected.anchor,
        first: [first.x as u32, first.y as u32],
        last: [last.x as u32, last.y as u32],
        a: projected.a,
        b: projected.b,
        c: projected.c,
        away: projected.away,
        normal,
        filter,
        copies: 1,
    })
}

/// All splats of a scene that may touch a pixel, in the order of the surfels; one for all that are the same where one has many
/// copies.
pub fn reference_all(scene: &Scene, camera: &Camera, options: &RenderOptions) -> Vec<Splat> {
    let design = Design::of(options);
    let surfels = scene.surfels.par_iter().enumerate();
    let eye = camera.eye - scene.origin;
    let copies = (has_copies(scene) && options.draws_copies_once()).then(|| copies(scene));
    let project = |(index, surfel): (usize, &Surfel)| {
        let copies = copies.as_ref().map_or(1, |copies| copies[index]);
        let splat = || reference((index as u32, surfel), scene.center(index) - eye, camera, &design);
        (copies > 0).then(splat).flatten().map(|splat| Splat { copies, ..splat })
    };
    surfels.filter_map(project).collect()
}

/// Splats in device memory, page for page as the surfels, whose attributes later stages still read.
pub struct SplatBuffer {
    /// The surfels they come from.
    pub surfels: SurfelBuffer,
    /// A page of splats for each page of surfels.
    pub pages: Vec<SplatPage>,
    /// The room that a view needs is known.
    measured: bool,
}

/// One page of a [`SplatBuffer`]. It has slots for the splats of all its surfels, in their order, or, where batches are left
/// out, of as many batches as there were to be drawn, one after the other ([`cull`](super::cull)).
pub struct SplatPage {
    /// The records.
    pub splats: Buffer<layout::Splat>,
    /// Which batches are projected.
    pub(super) batches: Batches,
    /// Counts and a grid, then the slots of the large splats, which get a workgroup each.
    pub(super) queue: Buffer<u32>,
    /// In the same form the splats that take long to project, which get a dispatch of their own.
    rare: Buffer<u32>,
    /// Their low-pass filters, if there are any.
    filters: Option<Buffer<layout::Filter>>,
}

/// How many splats a frame has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tally {
    /// Those that may touch a pixel of the image, and are not known to be hidden.
    pub(crate) drawn: u64,
    /// The most large ones of a page.
    pub(crate) most_large: u32,
    /// There was room for all of them, if batches are left out.
    pub(crate) held: bool,
}

/// Records the projection of `part` of every page; where batches are left out, after [`cull::record`](super::cull::record) has
/// listed them.
pub fn record(recorder: &mut Recorder<'_>, buffer: &SplatBuffer, part: Part) -> Result<()> {
    let (gpu, program, culled) = (recorder.gpu, recorder.program, recorder.variant.needs.cull);
    let view = recorder.view.bound();
    recorder.timing.pass(
        gpu,
        "project",
        |encoder| {
            for page in &buffer.pages {
                for list in [Some(&page.rare), (!culled).then_some(&page.queue)].into_iter().flatten() {
                    encoder.clear_buffer(&list.raw, 0, Some(u64::from(layout::QUEUE_START) * 4));
                }
            }
        },
        |pass| {
            for (surfels, page) in buffer.surfels.pages.iter().zip(&buffer.pages) {
                let (slots, drawn) = page.of(gpu, part, culled)?;
                let mut buffers = vec![
                    ("view", view.clone()),
                    ("surfels", surfels.surfels.bound()),
                    ("splats", page.splats.bound()),
                    ("queue", page.queue.bound()),
                    ("rare", page.rare.bound()),
                    ("listed", page.rare.bound()),
                ];
                buffers.extend(surfels.low.as_ref().map(|low| ("centers_low", low.bound())));
                buffers.extend(surfels.copies.as_ref().map(|copies| ("copies", copies.bound())));
                buffers.extend(page.filters.as_ref().map(|filters| ("filters", filters.bound())));
                buffers.extend(drawn);
                program.dispatch(gpu, pass, "project", &buffers, slots)?;
                program.dispatch(gpu, pass, "arrange_rare", &buffers, Grid::Of((1, 1)))?;
                let at = u64::from(layout::QUEUE_GRID) * 4;
                program.dispatch(gpu, pass, "project_rare", &buffers, Grid::In(&page.rare.raw, at))?;
                program.dispatch(gpu, pass, "arrange", &buffers, Grid::Of((1, 1)))?;
            }
            Ok(())
        },
    )
}

impl SplatPage {
    /// A page without slots, for `surfels` surfels.
    fn new(gpu: &Gpu, surfels: u64, low_pass: LowPass) -> Result<Self> {
        let list = |what| Buffer::indirect(gpu, what, layout::QUEUE_START.into());
        Ok(Self {
            splats: Buffer::storage(gpu, "splats", 0)?,
            batches: Batches::new(gpu, surfels)?,
            queue: list("queue of large splats")?,
            rare: list("list of rare splats")?,
            filters: match low_pass {
                LowPass::None => None,
                _ => Some(Buffer::storage(gpu, "low-pass filters", 0)?),
            },
        })
    }

    /// Has at least `slots`, and all that is stored.
    fn grow(&mut self, gpu: &Gpu, slots: u64) -> Result<()> {
        if self.splats.len < slots {
            let list = slots + u64::from(layout::QUEUE_START);
            self.splats.grow(gpu, "splats", slots)?;
            self.queue.grow(gpu, "queue of large splats", list)?;
            self.rare.grow(gpu, "list of rare splats", list)?;
            if let Some(filters) = &mut self.filters {
                filters.grow(gpu, "low-pass filters", slots)?;
            }
        }
        Ok(())
    }

    /// A workgroup for every [`layout::WORKGROUP`] slots of `part`, and what says which surfels they are for where batches are
    /// left out.
    pub(super) fn of(
        &self,
        gpu: &Gpu,
        part: Part,
        culled: bool,
    ) -> Result<(Grid<'_>, Option<(&'static str, wgpu::BindingResource<'_>)>)> {
        if culled {
            let (grid, drawn) = self.batches.of(part);
            return Ok((grid, Some(drawn)));
        }
        Ok((Grid::Of(grid(gpu, self.splats.len)?), None))
    }
}

impl SplatBuffer {
    /// Splats of `surfels`. There is no room for them yet.
    pub fn new(gpu: &Gpu, surfels: SurfelBuffer, low_pass: LowPass) -> Result<Self> {
        let pages = surfels.pages.iter().map(|page| SplatPage::new(gpu, page.surfels.len, low_pass));
        Ok(Self { pages: pages.collect::<Result<_>>()?, surfels, measured: false })
    }

    /// Makes room for the splats of all surfels.
    pub fn make_room_for_all(&mut self, gpu: &Gpu) -> Result<()> {
        self.surfels.pages.iter().zip(&mut self.pages).try_for_each(|(of, page)| page.grow(gpu, of.surfels.len))
    }

    /// Makes room for the splats of the batches that are listed, and an eighth more for the next view. Waits for the device; does
    /// nothing where it has been done for an earlier view.
    pub fn make_room(&mut self, gpu: &Gpu, part: Part) -> Result<()> {
        if self.measured {
            return Ok(());
        }
        let lists: Vec<_> = self.pages.iter().map(|page| page.batches.counter()).collect();
        let listed = counts(gpu, &lists)?;
        for ((of, page), [_, batches]) in self.surfels.pages.iter().zip(&mut self.pages).zip(listed) {
            let slots = u64::from(batches) * u64::from(layout::BATCH);
            if slots > page.splats.len {
                // Whole batches: the last one may be listed anywhere.
                let [slots, all] =
                    [slots + slots / 8, of.surfels.len].map(|n| n.next_multiple_of(layout::BATCH.into()));
                page.grow(gpu, slots.min(all))?;
            }
        }
        self.measured = part == Part::Far;
        Ok(())
    }

    /// What says how many splats there are: two counters a page.
    pub(crate) fn counters(&self) -> impl Iterator<Item = &Buffer<u32>> {
        self.pages.iter().flat_map(|page| [&page.queue, page.batches.counter()])
    }

    /// What they say after a frame, the first of `counted`.
    pub(crate) fn tally(&self, counted: &mut impl Iterator<Item = [u32; 2]>) -> Tally {
        let mut tally = Tally { drawn: 0, most_large: 0, held: true };
        for (of, page) in self.surfels.pages.iter().zip(&self.pages) {
            let ([large, unseen], [_, batches]) =
                (counted.next().unwrap_or_default(), counted.next().unwrap_or_default());
            tally.drawn += of.count.saturating_sub(unseen.into());
            tally.most_large = tally.most_large.max(large);
            tally.held &= u64::from(batches) * u64::from(layout::BATCH) <= page.splats.len;
        }
        tally
    }

    /// Whether there are large splats. Waits for the projection.
    pub(crate) fn has_large(&self, gpu: &Gpu) -> Result<bool> {
        let queues: Vec<_> = self.pages.iter().map(|page| &page.queue).collect();
        Ok(counts(gpu, &queues)?.iter().any(|[large, _]| *large > 0))
    }

    /// The room is measured again.
    pub(crate) fn forget_room(&mut self) {
        self.measured = false;
    }

    /// Device memory that the splats and their surfels take, bytes.
    pub fn bytes(&self) -> u64 {
        let of_page = |page: &SplatPage| {
            let lists = page.batches.bytes() + page.queue.bytes() + page.rare.bytes();
            page.splats.bytes() + lists + page.filters.as_ref().map_or(0, Buffer::bytes)
        };
        self.surfels.bytes() + self.pages.iter().map(of_page).sum::<u64>()
    }

    /// What a stage over the splats of page `index` may bind, beside its own `buffers`.
    pub(crate) fn bindings<'a>(&'a self, index: usize, buffers: &[(&'a str, wgpu::BindingResource<'a>)]) -> Bound<'a> {
        let (surfels, page) = (&self.surfels.pages[index], &self.pages[index]);
        let mut bound = vec![
            ("projected", page.splats.bound()),
            ("queued", page.queue.bound()),
            ("surfels", surfels.surfels.bound()),
        ];
        bound.extend_from_slice(buffers);
        bound.extend(page.filters.as_ref().map(|filters| ("projected_filters", filters.bound())));
        bound.extend(surfels.copies.as_ref().map(|copies| ("copies", copies.bound())));
        bound.extend(surfels.colors.as_ref().map(|colors| ("colors", colors.as_entire_binding())));
        bound.extend(self.surfels.srgb_to_linear.as_ref().map(|table| ("srgb_to_linear", table.bound())));
        bound
    }

    /// Records `stage` over the splats of `part` of every page, an invocation each.
    pub(crate) fn dispatch(
        &self,
        recorder: &mut Recorder<'_>,
        (stage, part): (&'static str, Part),
        rows: &Rows,
        buffers: &[(&str, wgpu::BindingResource<'_>)],
        before: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> Result<()> {
        let (gpu, program, culled) = (recorder.gpu, recorder.program, recorder.variant.needs.cull);
        let own = with_view(recorder, rows, buffers);
        recorder.timing.pass(gpu, stage, before, |pass| {
            for (index, page) in self.pages.iter().enumerate() {
                let mut bound = self.bindings(index, &own);
                let (slots, drawn) = page.of(gpu, part, culled)?;
                bound.extend(drawn);
                program.dispatch(gpu, pass, stage, &bound, slots)?;
            }
            Ok(())
        })
    }

    /// Records `kernel` over the large splats of every page, a workgroup each, as a part of `stage`.
    pub(crate) fn dispatch_large(
        &self,
        recorder: &mut Recorder<'_>,
        (stage, kernel): (&'static str, &'static str),
        rows: &Rows,
        buffers: &[(&str, wgpu::BindingResource<'_>)],
    ) -> Result<()> {
        let (gpu, program) = (recorder.gpu, recorder.program);
        let own = with_view(recorder, rows, buffers);
        recorder.timing.pass(
            gpu,
            stage,
            |_| {},
            |pass| {
                for (index, page) in self.pages.iter().enumerate() {
                    let grid = Grid::In(&page.queue.raw, u64::from(layout::QUEUE_GRID) * 4);
                    program.dispatch(gpu, pass, kernel, &self.bindings(index, &own), grid)?;
                }
                Ok(())
            },
        )
    }
}

/// The uniforms of every stage over splats, and `buffers`.
fn with_view<'a>(
    recorder: &Recorder<'a>,
    rows: &'a Rows,
    buffers: &[(&'a str, wgpu::BindingResource<'a>)],
) -> Bound<'a> {
    let mut own = vec![("view", recorder.view.bound()), ("band", rows.uniform.bound())];
    own.extend_from_slice(buffers);
    own
}
