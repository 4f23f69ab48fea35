//! Records a frame into the encoder of a user's program: no submission, no wait and no read-back.

use std::sync::Arc;

use super::count::Capacities;
use super::kernels::Kernels;
use super::run::Run;
use super::sequence;
use super::store::Store;
use super::texture::{Rows, Textured};
use super::ticket::Part;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::buffers::Buffer;
use crate::gpu::kernel::Grid;
use crate::gpu::layout::View;
use crate::gpu::program::Program;
use crate::gpu::timing::Timing;
use crate::gpu::{Gpu, Sources};
use crate::plan::{Known, Plan};

/// Words of the verdict: 1 if the frame is complete, the bits of what it lacks, and two zeros.
pub(super) const VERDICT_WORDS: u64 = 4;

/// Where the image of a part of a frame goes.
pub(super) struct Recording<'a> {
    /// The buffer that takes the image, and the byte at which the next band starts in it.
    image: Option<(&'a wgpu::Buffer, u64)>,
    /// The textures that take values of the image, and the rows from which they are copied.
    pub textures: &'a [Textured<'a>],
    pub rows: Option<&'a Rows>,
    /// The buffer that takes the counts.
    counts: &'a wgpu::Buffer,
    /// Bytes of counts so far.
    counted: u64,
    capacities: &'a Capacities,
}

/// The kernel and the buffers by which a part of a frame is judged.
struct Judged {
    program: Arc<Program>,
    counts: Buffer<[u32; 2]>,
    limits: Buffer<[u32; 4]>,
}

/// The buffers of a part that its recorded frames alone need.
#[derive(Default)]
pub(super) struct OfRecording {
    judged: Option<Judged>,
    rows: Option<Rows>,
}

impl Judged {
    /// Makes the buffers of `kept` hold `count` counts.
    fn fit<'a>(kept: &'a mut Option<Self>, (gpu, sources): (&Gpu, &Sources), count: u64) -> Result<&'a Self> {
        let made = match kept.take().filter(|kept| kept.counts.len >= count) {
            Some(large) => large,
            None => {
                let program = gpu.compiled.without_arithmetic(gpu, (sources, "verdict.wgsl"), "judge_frame")?;
                let counts = Buffer::storage(gpu, "counts of a frame", count)?;
                Self { program, counts, limits: Buffer::storage(gpu, "limits of a frame", count + 1)? }
            }
        };
        Ok(kept.insert(made))
    }

    /// Records the copies of the view and of the limits of all counts to the device.
    fn give(
        &self,
        gpu: &Gpu,
        (view, uniform): (&View, &Buffer<u32>),
        limits: &[[u32; 4]],
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<()> {
        let (head, count) = (size_of::<View>() as u64, [[limits.len() as u32, 0, 0, 0]]);
        let pieces = [bytemuck::bytes_of(view), bytemuck::cast_slice(&count), bytemuck::cast_slice(limits)];
        let given = staged(gpu, wgpu::BufferUsages::COPY_SRC, &pieces)?;
        encoder.copy_buffer_to_buffer(&given, 0, &uniform.raw, 0, head);
        encoder.copy_buffer_to_buffer(&given, head, &self.limits.raw, 0, given.size() - head);
        Ok(())
    }

    /// Records the kernel that compares all counts with their limits.
    fn judge(&self, gpu: &Gpu, timing: &mut Timing<'_>, verdict: &Buffer<u32>) -> Result<()> {
        let binding = |name: &str| match name {
            "frame_counts" => Some(self.counts.bound()),
            "frame_limits" => Some(self.limits.bound()),
            "verdict" => Some(verdict.bound()),
            _ => None,
        };
        let once = Grid::Of((1, 1));
        let judge = |pass: &mut wgpu::ComputePass<'_>| self.program.dispatch(gpu, pass, "judge_frame", &binding, once);
        timing.pass(gpu, "verdict", |_| {}, judge)
    }
}

/// The target and the verdict that all parts of a recorded frame share.
pub(super) struct Recorder<'a> {
    /// The caller's encoder.
    pub encoder: &'a mut wgpu::CommandEncoder,
    /// The buffer that takes the image, and the byte at which the next part starts in it.
    pub image: Option<(&'a wgpu::Buffer, u64)>,
    /// The textures that take values of the next part.
    pub textures: Vec<Textured<'a>>,
    /// The verdict on the frame so far.
    pub verdict: &'a Buffer<u32>,
}

/// Records the part of a frame that `plan` describes. The sizes in `known` were measured before.
pub(super) fn record(
    (gpu, sources): (&Gpu, &Sources),
    (plan, view): (&Plan, &View),
    (kernels, store, known): (&Kernels, &mut Store, &mut Known),
    OfRecording { judged, rows }: &mut OfRecording,
    recorder: &mut Recorder<'_>,
) -> Result<Part> {
    let capacities = Capacities::of(plan, store, plan.large_by_tiles);
    let capacities = capacities.with_fragments(plan, store, gpu.adapter.is_software());
    let bands = if counts_each_band(plan) { plan.bands.len() } else { 1 };
    let limits = capacities.limits().repeat(bands);
    let count = limits.len() as u64;
    let judged = Judged::fit(judged, (gpu, sources), count)?;
    let uniform = store.buffer("view").ok_or_else(|| gpu.error("a frame has no view"))?;
    judged.give(gpu, (view, uniform), &limits, recorder.encoder)?;
    let mut run = Run::new(gpu, plan, kernels, store, known);
    Rows::fit(rows, (gpu, sources), plan, &recorder.textures)?;
    run.timing = Timing::lent(gpu, recorder.encoder);
    run.recording = Some(Recording {
        image: recorder.image,
        textures: &recorder.textures,
        rows: rows.as_ref(),
        counts: &judged.counts.raw,
        counted: 0,
        capacities: &capacities,
    });
    run.steps(&sequence::steps(plan), &mut Frame::of_colors(0, 0, Vec::new()), &())?;
    let pixels: u64 = (0..plan.bands.len()).map(|band| plan.image_pixels(band)).sum();
    let next = |(image, first)| (image, first + 4 * u64::from(plan.pixel.image_words) * pixels);
    recorder.image = recorder.image.map(next);
    let mut timing = run.timing;
    judged.judge(gpu, &mut timing, recorder.verdict)?;
    let bytes = 8 * count + timing.bytes_of_stamps();
    let tray = gpu.tray(bytes);
    timing.encoder(gpu).copy_buffer_to_buffer(&judged.counts.raw, 0, &tray, 0, 8 * count);
    let stages = timing.record_stamps(gpu, &tray, 8 * count);
    let counted = (capacities, count, plan.projects_each_band);
    Ok(Part::mapped_on_submit((tray, bytes), recorder.encoder, counted, stages))
}

/// Whether each band makes counts that the next one resets.
fn counts_each_band(plan: &Plan) -> bool {
    plan.projects_each_band || plan.needs.surface.lists().is_some()
}

/// Returns a new buffer of a `usage` that holds `pieces`. Every frame has a buffer of its own, as
/// several may be recorded before the first is submitted.
pub(super) fn staged(gpu: &Gpu, usage: wgpu::BufferUsages, pieces: &[&[u8]]) -> Result<wgpu::Buffer> {
    let all = pieces.concat();
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("values of a frame"),
        size: all.len().next_multiple_of(4) as u64,
        usage,
        mapped_at_creation: true,
    });
    let mut mapped = buffer.slice(..).get_mapped_range_mut().map_err(|e| gpu.error(format!("writing failed: {e}")))?;
    mapped.slice(..all.len()).copy_from_slice(&all);
    drop(mapped);
    buffer.unmap();
    Ok(buffer)
}

impl Run<'_> {
    /// Records the copies of a band's image, and of the counts that the next band resets.
    pub(super) fn record_band(&mut self, band: usize) -> Result<()> {
        let counts = counts_each_band(self.plan) || band + 1 == self.plan.bands.len();
        self.record_textures(band)?;
        let Some(Recording { image, counts: into, counted, capacities, .. }) = &mut self.recording else {
            return Ok(());
        };
        let (from, _) = self.store.image().ok_or_else(|| self.gpu.error("a frame has no image"))?;
        let bytes = self.plan.image_pixels(band) * u64::from(self.plan.pixel.image_words) * 4;
        let encoder = self.timing.encoder(self.gpu);
        if let Some((image, next)) = image {
            encoder.copy_buffer_to_buffer(&from.raw, 0, image, *next, bytes);
            *next += bytes;
        }
        if counts {
            for (buffer, word) in capacities.counters(self.store) {
                encoder.copy_buffer_to_buffer(&buffer.raw, 4 * word, into, *counted, 8);
                *counted += 8;
            }
        }
        Ok(())
    }
}

/// The error of a frame that reads counts in its middle.
pub(super) fn reads_in_its_middle() -> Error {
    Error::Usage(
        "the host has to read counts in the middle of this frame, so it cannot be recorded into an encoder: render it"
            .into(),
    )
}
