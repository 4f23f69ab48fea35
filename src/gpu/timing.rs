//! Records the passes of a frame into one submission, with the time of each: GPU timestamps where
//! the adapter has them, wall time where not.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use super::buffers::{Buffer, Image, Words, read};
use super::device::Gpu;
use super::spare::{PASSES, Spare, Stamps};
use crate::error::{Error, Result};

/// The encoder that a frame is recorded into.
enum Commands<'e> {
    /// The frame's own: commands that are recorded and not yet submitted. They are submitted when
    /// the host next reads device memory, or, where wall time is measured, at the end of each
    /// stage.
    Own(Option<wgpu::CommandEncoder>),
    /// The caller's, who submits it.
    Lent(&'e mut wgpu::CommandEncoder),
}

impl Commands<'_> {
    fn encoder(&mut self, gpu: &Gpu) -> &mut wgpu::CommandEncoder {
        match self {
            Self::Own(encoder) => encoder.get_or_insert_with(|| gpu.encoder()),
            Self::Lent(encoder) => encoder,
        }
    }
}

/// Queries of timestamps that a frame has taken from those of its device.
struct Taken {
    /// Two queries per stage so far; `None` if timestamps are not used.
    stamps: Option<Vec<Stamps>>,
    spare: Arc<Spare>,
}

impl Drop for Taken {
    fn drop(&mut self) {
        self.spare.keep_stamps(self.stamps.take().unwrap_or_default());
    }
}

/// Records the stages of a frame, and measures the time of each.
pub struct Timing<'e> {
    taken: Taken,
    stages: Vec<&'static str>,
    commands: Commands<'e>,
    /// The timestamps that were read so far.
    ticks: Vec<u64>,
    wall: BTreeMap<&'static str, f64>,
}

/// Whether the device's timestamps are those of the passes.
fn has_timestamps(gpu: &Gpu) -> bool {
    // Mesa's software adapter, once it has drawn triangles, writes the timestamps of compute
    // passes before they run. It runs one pass at a time, so wall time is as good then.
    let trusted = !gpu.adapter.is_software() || gpu.adapter.api == "vulkan" && !gpu.spare.draws();
    gpu.adapter.timestamps && trusted
}

/// Returns the milliseconds of each of `stages`, given the timestamps of their starts and ends.
pub(crate) fn times(gpu: &Gpu, stages: &[&'static str], ticks: &[u64]) -> BTreeMap<&'static str, f64> {
    let period_ms = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
    let mut times = BTreeMap::new();
    for (stage, pair) in stages.iter().zip(ticks.chunks_exact(2)) {
        *times.entry(*stage).or_default() += pair[1].saturating_sub(pair[0]) as f64 * period_ms;
    }
    times
}

impl<'e> Timing<'e> {
    /// Creates a timing without stages.
    pub fn new(gpu: &Gpu) -> Self {
        Self::by(gpu, has_timestamps(gpu), Commands::Own(None))
    }

    /// Creates a timing that records into the caller's `encoder`, and never submits or waits.
    /// Without timestamps of the device, nothing is measured.
    pub(crate) fn lent(gpu: &Gpu, encoder: &'e mut wgpu::CommandEncoder) -> Self {
        Self::by(gpu, has_timestamps(gpu), Commands::Lent(encoder))
    }

    /// Creates a timing that uses timestamps of the device, or wall time.
    fn by(gpu: &Gpu, on_device: bool, commands: Commands<'e>) -> Self {
        Self {
            taken: Taken { stamps: on_device.then(Vec::new), spare: Arc::clone(&gpu.spare) },
            stages: Vec::new(),
            commands,
            ticks: Vec::new(),
            wall: BTreeMap::new(),
        }
    }

    /// Returns the queries of the next stage: a set, and the first of two queries in it.
    fn next(&mut self, gpu: &Gpu) -> Option<(wgpu::QuerySet, u32)> {
        let Taken { stamps, spare } = &mut self.taken;
        let all = stamps.as_mut()?;
        if self.stages.len() == all.len() * PASSES {
            all.push(spare.stamps(gpu));
        }
        Some((all.last()?.queries.clone(), 2 * (self.stages.len() % PASSES) as u32))
    }

    /// Whether times are the device's own timestamps.
    pub fn on_device(&self) -> bool {
        self.taken.stamps.is_some()
    }

    /// Records a compute pass that counts as `stage`; `before` records commands before the pass.
    pub(crate) fn pass(
        &mut self,
        gpu: &Gpu,
        stage: &'static str,
        before: impl FnOnce(&mut wgpu::CommandEncoder),
        record: impl FnOnce(&mut wgpu::ComputePass<'_>) -> Result<()>,
    ) -> Result<()> {
        let queries = self.next(gpu);
        let encoder = self.commands.encoder(gpu);
        before(encoder);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(stage),
            timestamp_writes: queries.as_ref().map(|(set, first)| wgpu::ComputePassTimestampWrites {
                query_set: set,
                beginning_of_pass_write_index: Some(*first),
                end_of_pass_write_index: Some(*first + 1),
            }),
        });
        record(&mut pass)?;
        drop(pass);
        self.end(gpu, stage)
    }

    /// Records a render pass into `targets` and `depth` that counts as `stage`.
    pub(crate) fn draw(
        &mut self,
        gpu: &Gpu,
        stage: &'static str,
        targets: &[Option<wgpu::RenderPassColorAttachment<'_>>],
        depth: Option<wgpu::RenderPassDepthStencilAttachment<'_>>,
        record: impl FnOnce(&mut wgpu::RenderPass<'_>) -> Result<()>,
    ) -> Result<()> {
        let queries = self.next(gpu);
        let encoder = self.commands.encoder(gpu);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(stage),
            color_attachments: targets,
            depth_stencil_attachment: depth,
            timestamp_writes: queries.as_ref().map(|(set, first)| wgpu::RenderPassTimestampWrites {
                query_set: set,
                beginning_of_pass_write_index: Some(*first),
                end_of_pass_write_index: Some(*first + 1),
            }),
            ..Default::default()
        });
        record(&mut pass)?;
        drop(pass);
        self.end(gpu, stage)
    }

    /// Records commands outside passes, such as copies, that count as `stage`. They are timed from
    /// the end of an empty pass to the start of another.
    #[cfg(any(test, feature = "bench"))]
    pub(crate) fn around(
        &mut self,
        gpu: &Gpu,
        stage: &'static str,
        record: impl FnOnce(&mut wgpu::CommandEncoder),
    ) -> Result<()> {
        let queries = self.next(gpu);
        let encoder = self.commands.encoder(gpu);
        let mark = |encoder: &mut wgpu::CommandEncoder, after: bool| {
            let Some((set, first)) = &queries else { return };
            drop(encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(stage),
                timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                    query_set: set,
                    beginning_of_pass_write_index: after.then_some(*first + 1),
                    end_of_pass_write_index: (!after).then_some(*first),
                }),
            }));
        };
        mark(encoder, false);
        record(encoder);
        mark(encoder, true);
        self.end(gpu, stage)
    }

    /// Ends a stage. Where wall time is measured, submits it and waits for it.
    fn end(&mut self, gpu: &Gpu, stage: &'static str) -> Result<()> {
        self.stages.push(stage);
        if self.taken.stamps.is_some() || matches!(self.commands, Commands::Lent(_)) {
            return Ok(());
        }
        let start = Instant::now();
        self.flush(gpu)?;
        gpu.wait()?;
        *self.wall.entry(stage).or_default() += start.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }

    /// Submits all recorded commands. Callers must do this before they submit commands of their
    /// own.
    pub(crate) fn flush(&mut self, gpu: &Gpu) -> Result<()> {
        match &mut self.commands {
            Commands::Own(encoder) => encoder.take().into_iter().for_each(|encoder| gpu.submit(encoder)),
            Commands::Lent(_) => return Err(not_submitted(gpu)),
        }
        gpu.check()
    }

    /// Returns the encoder, for commands outside passes that no stage counts.
    pub(crate) fn encoder(&mut self, gpu: &Gpu) -> &mut wgpu::CommandEncoder {
        self.commands.encoder(gpu)
    }

    /// Submits all recorded commands, and reads two consecutive words of each of `counts`, from the
    /// given word on. Waits once.
    pub(crate) fn counts(&mut self, gpu: &Gpu, counts: &[(&Buffer<u32>, u64)]) -> Result<Vec<[u32; 2]>> {
        self.read(gpu, counts, None)
    }

    /// Submits all recorded commands, and reads `counts` as [`counts`](Self::counts) does, the
    /// `image` and the times of the stages since the last call. Waits once, and once more for each
    /// further piece of the image.
    pub(crate) fn read(
        &mut self,
        gpu: &Gpu,
        counts: &[(&Buffer<u32>, u64)],
        image: Option<Image<'_>>,
    ) -> Result<Vec<[u32; 2]>> {
        let Commands::Own(own) = &mut self.commands else { return Err(not_submitted(gpu)) };
        let mut encoder = own.take().unwrap_or_else(|| gpu.encoder());
        let counted = counts.iter().map(|(buffer, word)| Words { buffer: &buffer.raw, first: 4 * word, count: 1 });
        let mut words: Vec<_> = counted.collect();
        let (done, all) = (self.ticks.len() / 2, self.stages.len());
        for (stamps, first) in self.taken.stamps.iter().flatten().zip((0..all).step_by(PASSES)) {
            let new = done.clamp(first, first + PASSES) - first..all.min(first + PASSES) - first;
            if !new.is_empty() {
                let queries = 2 * new.start as u32..2 * new.end as u32;
                encoder.resolve_query_set(&stamps.queries, queries, &stamps.resolved, 0);
                words.push(Words { buffer: &stamps.resolved, first: 0, count: 2 * new.len() as u64 });
            }
        }
        let mut values = read(gpu, encoder, &words, image)?;
        self.ticks.extend(values.split_off(counts.len()));
        Ok(values.into_iter().map(bytemuck::cast).collect())
    }

    /// Returns the milliseconds of each stage.
    pub fn finish(mut self, gpu: &Gpu) -> Result<BTreeMap<&'static str, f64>> {
        if !self.on_device() {
            self.flush(gpu)?;
            return Ok(std::mem::take(&mut self.wall));
        }
        if self.ticks.len() < 2 * self.stages.len() {
            self.counts(gpu, &[])?;
        }
        Ok(times(gpu, &self.stages, &self.ticks))
    }

    /// Bytes of the timestamps of all stages so far; 0 where the device has none.
    pub(crate) fn bytes_of_stamps(&self) -> u64 {
        if self.on_device() { 16 * self.stages.len() as u64 } else { 0 }
    }

    /// Records the copy of the timestamps of all stages to `tray`, from byte `at` on. Returns the
    /// names of the stages; none where the device has no timestamps.
    pub(crate) fn record_stamps(mut self, gpu: &Gpu, tray: &wgpu::Buffer, at: u64) -> Vec<&'static str> {
        let stages = if self.on_device() { std::mem::take(&mut self.stages) } else { Vec::new() };
        let encoder = self.commands.encoder(gpu);
        for (stamps, first) in self.taken.stamps.iter().flatten().zip((0..stages.len()).step_by(PASSES)) {
            let count = (stages.len() - first).min(PASSES);
            encoder.resolve_query_set(&stamps.queries, 0..2 * count as u32, &stamps.resolved, 0);
            let bytes = 16 * count as u64;
            encoder.copy_buffer_to_buffer(&stamps.resolved, 0, tray, at + 16 * first as u64, bytes);
        }
        stages
    }
}

/// The error of a read in the middle of commands that the caller has not submitted yet.
fn not_submitted(gpu: &Gpu) -> Error {
    gpu.error("a frame that is recorded into an encoder cannot be read in its middle")
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
mod tests {
    use super::*;

    #[test]
    fn a_device_times_more_passes_than_a_query_set_holds() {
        let required = std::env::var("EPSPLAT_REQUIRE_ADAPTER").is_ok_and(|value| value == "1");
        let gpu = match Gpu::open(None) {
            Ok(gpu) => gpu,
            Err(error) if required => panic!("an adapter is required, but {error}"),
            Err(_) => return,
        };
        if !gpu.adapter.timestamps {
            return;
        }
        let mut timing = Timing::by(&gpu, true, Commands::Own(None));
        for number in 0..2 * PASSES + 3 {
            timing.pass(&gpu, if number % 2 == 0 { "even" } else { "odd" }, |_| {}, |_| Ok(())).unwrap();
        }
        assert!(matches!(timing.commands, Commands::Own(Some(_))), "all passes are submitted at once");
        timing.around(&gpu, "between", |_| {}).unwrap();
        timing.flush(&gpu).unwrap();
        gpu.wait().unwrap();
        assert_eq!(timing.taken.stamps.as_ref().map(Vec::len), Some(3));
        let times = timing.finish(&gpu).unwrap();
        assert_eq!(times.keys().copied().collect::<Vec<_>>(), ["between", "even", "odd"]);
        assert!(times.values().all(|ms| ms.is_finite() && *ms >= 0.0), "{times:?}");
    }
}
