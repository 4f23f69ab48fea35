//! Time per pass: GPU timestamps where the adapter has them, wall time where not.

use std::collections::BTreeMap;
use std::time::Instant;

use super::buffers::Buffer;
use super::device::Gpu;
use crate::error::Result;

/// Passes per query set.
const PASSES: usize = 256;

/// Measures the time of each recorded stage.
pub struct Timing {
    /// Two queries per stage so far; `None` if wall time is measured.
    queries: Option<Vec<wgpu::QuerySet>>,
    stages: Vec<&'static str>,
    /// Recorded but not yet submitted command buffers. They are submitted together when the host
    /// next reads device memory.
    pending: Vec<wgpu::CommandBuffer>,
    wall: BTreeMap<&'static str, f64>,
}

impl Timing {
    /// Creates a timing without stages.
    pub fn new(gpu: &Gpu) -> Self {
        // A software adapter runs one pass at a time, so wall time is as good. Mesa's software
        // adapter, once it has drawn triangles, even writes the timestamps of compute passes before
        // they run.
        Self::by(gpu.adapter.timestamps && gpu.adapter.kind != "software")
    }

    /// Creates a timing that uses timestamps of the device, or wall time.
    fn by(on_device: bool) -> Self {
        Self { queries: on_device.then(Vec::new), stages: Vec::new(), pending: Vec::new(), wall: BTreeMap::new() }
    }

    /// Returns the queries of the next stage: a set, and the first of two queries in it.
    fn next(&mut self, gpu: &Gpu) -> Option<(&wgpu::QuerySet, u32)> {
        let sets = self.queries.as_mut()?;
        if self.stages.len() == sets.len() * PASSES {
            sets.push(gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * PASSES as u32,
            }));
        }
        Some((sets.last()?, 2 * (self.stages.len() % PASSES) as u32))
    }

    /// Whether times are the device's own timestamps.
    pub fn on_device(&self) -> bool {
        self.queries.is_some()
    }

    /// Records a compute pass that counts as `stage`; `before` records commands before the pass.
    pub(crate) fn pass(
        &mut self,
        gpu: &Gpu,
        stage: &'static str,
        before: impl FnOnce(&mut wgpu::CommandEncoder),
        record: impl FnOnce(&mut wgpu::ComputePass<'_>) -> Result<()>,
    ) -> Result<()> {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        before(&mut encoder);
        let queries = self.next(gpu);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(stage),
            timestamp_writes: queries.map(|(set, first)| wgpu::ComputePassTimestampWrites {
                query_set: set,
                beginning_of_pass_write_index: Some(first),
                end_of_pass_write_index: Some(first + 1),
            }),
        });
        record(&mut pass)?;
        drop(pass);
        self.submit(gpu, stage, encoder)
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
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let queries = self.next(gpu);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(stage),
            color_attachments: targets,
            depth_stencil_attachment: depth,
            timestamp_writes: queries.map(|(set, first)| wgpu::RenderPassTimestampWrites {
                query_set: set,
                beginning_of_pass_write_index: Some(first),
                end_of_pass_write_index: Some(first + 1),
            }),
            ..Default::default()
        });
        record(&mut pass)?;
        drop(pass);
        self.submit(gpu, stage, encoder)
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
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let queries = self.next(gpu);
        let mark = |encoder: &mut wgpu::CommandEncoder, after: bool| {
            let Some((set, first)) = queries else { return };
            drop(encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(stage),
                timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                    query_set: set,
                    beginning_of_pass_write_index: after.then_some(first + 1),
                    end_of_pass_write_index: (!after).then_some(first),
                }),
            }));
        };
        mark(&mut encoder, false);
        record(&mut encoder);
        mark(&mut encoder, true);
        self.submit(gpu, stage, encoder)
    }

    fn submit(&mut self, gpu: &Gpu, stage: &'static str, encoder: wgpu::CommandEncoder) -> Result<()> {
        self.stages.push(stage);
        if self.queries.is_some() {
            self.pending.push(encoder.finish());
            return Ok(());
        }
        let start = Instant::now();
        gpu.queue.submit([encoder.finish()]);
        gpu.wait()?;
        *self.wall.entry(stage).or_default() += start.elapsed().as_secs_f64() * 1e3;
        gpu.check()
    }

    /// Submits all recorded commands. Callers must do this before they read from the device or
    /// submit copies of their own.
    pub(crate) fn flush(&mut self, gpu: &Gpu) -> Result<()> {
        if !self.pending.is_empty() {
            gpu.queue.submit(self.pending.drain(..));
        }
        gpu.check()
    }

    /// Returns the milliseconds of each stage.
    pub fn finish(mut self, gpu: &Gpu) -> Result<BTreeMap<&'static str, f64>> {
        self.flush(gpu)?;
        let Some(sets) = self.queries else { return Ok(self.wall) };
        let period_ms = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
        let mut times = BTreeMap::new();
        for (set, stages) in sets.iter().zip(self.stages.chunks(PASSES)) {
            let count = 2 * stages.len() as u64;
            let raw = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: count * 8,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            let buffer = Buffer::<u64>::from_raw(raw, count);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            encoder.resolve_query_set(set, 0..count as u32, &buffer.raw, 0);
            gpu.queue.submit([encoder.finish()]);
            let ticks = buffer.read(gpu, count)?;
            for (stage, pair) in stages.iter().zip(ticks.chunks_exact(2)) {
                *times.entry(*stage).or_default() += pair[1].saturating_sub(pair[0]) as f64 * period_ms;
            }
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
        let mut timing = Timing::by(true);
        for number in 0..2 * PASSES + 3 {
            timing.pass(&gpu, if number % 2 == 0 { "even" } else { "odd" }, |_| {}, |_| Ok(())).unwrap();
        }
        assert_eq!(timing.pending.len(), 2 * PASSES + 3, "a card is handed each pass by itself");
        timing.around(&gpu, "between", |_| {}).unwrap();
        timing.flush(&gpu).unwrap();
        gpu.wait().unwrap();
        assert_eq!(timing.queries.as_ref().map(Vec::len), Some(3));
        let times = timing.finish(&gpu).unwrap();
        assert_eq!(times.keys().copied().collect::<Vec<_>>(), ["between", "even", "odd"]);
        assert!(times.values().all(|ms| ms.is_finite() && *ms >= 0.0), "{times:?}");
    }
}
