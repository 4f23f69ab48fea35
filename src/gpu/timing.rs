//! Records the passes of a frame into one submission, with the time of each: GPU timestamps where
//! the adapter has them, wall time where not.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use super::buffers::{Buffer, Image, Words, read};
use super::device::Gpu;
use super::spare::{PASSES, Spare, Stamps};
use crate::error::Result;

/// Records the stages of a frame, and measures the time of each.
pub struct Timing {
    /// Two queries per stage so far; `None` if wall time is measured.
    stamps: Option<Vec<Stamps>>,
    stages: Vec<&'static str>,
    /// The commands that are recorded and not yet submitted. They are submitted when the host next
    /// reads device memory, or, where wall time is measured, at the end of each stage.
    encoder: Option<wgpu::CommandEncoder>,
    /// The timestamps that were read so far.
    ticks: Vec<u64>,
    wall: BTreeMap<&'static str, f64>,
    spare: Arc<Spare>,
}

impl Drop for Timing {
    fn drop(&mut self) {
        self.spare.keep_stamps(self.stamps.take().unwrap_or_default());
    }
}

impl Timing {
    /// Creates a timing without stages.
    pub fn new(gpu: &Gpu) -> Self {
        // Mesa's software adapter, once it has drawn triangles, writes the timestamps of compute
        // passes before they run. It runs one pass at a time, so wall time is as good then.
        let trusted = !gpu.adapter.is_software() || gpu.adapter.api == "vulkan" && !gpu.spare.draws();
        Self::by(gpu, gpu.adapter.timestamps && trusted)
    }

    /// Creates a timing that uses timestamps of the device, or wall time.
    fn by(gpu: &Gpu, on_device: bool) -> Self {
        Self {
            stamps: on_device.then(Vec::new),
            stages: Vec::new(),
            encoder: None,
            ticks: Vec::new(),
            wall: BTreeMap::new(),
            spare: Arc::clone(&gpu.spare),
        }
    }

    /// Returns the queries of the next stage: a set, and the first of two queries in it.
    fn next(&mut self, gpu: &Gpu) -> Option<(wgpu::QuerySet, u32)> {
        let all = self.stamps.as_mut()?;
        if self.stages.len() == all.len() * PASSES {
            all.push(self.spare.stamps(gpu));
        }
        Some((all.last()?.queries.clone(), 2 * (self.stages.len() % PASSES) as u32))
    }

    /// Whether times are the device's own timestamps.
    pub fn on_device(&self) -> bool {
        self.stamps.is_some()
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
        let encoder = self.encoder.get_or_insert_with(|| gpu.encoder());
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
        let encoder = self.encoder.get_or_insert_with(|| gpu.encoder());
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
        let encoder = self.encoder.get_or_insert_with(|| gpu.encoder());
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
        if self.stamps.is_some() {
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
        self.encoder.take().into_iter().for_each(|encoder| gpu.submit(encoder));
        gpu.check()
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
        let mut encoder = self.encoder.take().unwrap_or_else(|| gpu.encoder());
        let counted = counts.iter().map(|(buffer, word)| Words { buffer: &buffer.raw, first: 4 * word, count: 1 });
        let mut words: Vec<_> = counted.collect();
        let (done, all) = (self.ticks.len() / 2, self.stages.len());
        for (stamps, first) in self.stamps.iter().flatten().zip((0..all).step_by(PASSES)) {
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
        let period_ms = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
        let mut times = BTreeMap::new();
        for (stage, pair) in self.stages.iter().zip(self.ticks.chunks_exact(2)) {
            *times.entry(*stage).or_default() += pair[1].saturating_sub(pair[0]) as f64 * period_ms;
        }
        Ok(times)
    }
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
        let mut timing = Timing::by(&gpu, true);
        for number in 0..2 * PASSES + 3 {
            timing.pass(&gpu, if number % 2 == 0 { "even" } else { "odd" }, |_| {}, |_| Ok(())).unwrap();
        }
        assert!(timing.encoder.is_some(), "all passes are submitted at once");
        timing.around(&gpu, "between", |_| {}).unwrap();
        timing.flush(&gpu).unwrap();
        gpu.wait().unwrap();
        assert_eq!(timing.stamps.as_ref().map(Vec::len), Some(3));
        let times = timing.finish(&gpu).unwrap();
        assert_eq!(times.keys().copied().collect::<Vec<_>>(), ["between", "even", "odd"]);
        assert!(times.values().all(|ms| ms.is_finite() && *ms >= 0.0), "{times:?}");
    }
}
