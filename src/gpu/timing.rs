//! Time per pass: GPU timestamps where the adapter has them, wall time where not.

use std::collections::BTreeMap;
use std::time::Instant;

use super::buffers::Buffer;
use super::device::Gpu;
use crate::error::Result;

/// Collects the time of each recorded stage.
pub struct Timing {
    queries: Option<(wgpu::QuerySet, Buffer<u64>)>,
    stages: Vec<&'static str>,
    wall: BTreeMap<&'static str, f64>,
}

impl Timing {
    /// Room for `passes` recorded passes.
    pub fn new(gpu: &Gpu, passes: u32) -> Result<Self> {
        // A software adapter does one thing at a time, so wall time is as good; and Mesa's, once it has drawn triangles,
        // stamps compute passes before they run. WebGPU bounds a query set at 4,096; beyond that wall time serves.
        let clock = gpu.adapter.timestamps && gpu.adapter.kind != "software";
        let queries = if clock && passes * 2 <= wgpu::QUERY_SET_MAX_QUERIES {
            let set = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: passes * 2,
            });
            let raw = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: u64::from(passes) * 16,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            Some((set, Buffer::from_raw(raw, u64::from(passes) * 2)))
        } else {
            None
        };
        Ok(Self { queries, stages: Vec::new(), wall: BTreeMap::new() })
    }

    /// Whether times come from the device's own clock.
    pub fn on_device(&self) -> bool {
        self.queries.is_some()
    }

    /// Records a compute pass that counts as `stage`, and submits it.
    pub(crate) fn pass(
        &mut self,
        gpu: &Gpu,
        stage: &'static str,
        before: impl FnOnce(&mut wgpu::CommandEncoder),
        record: impl FnOnce(&mut wgpu::ComputePass<'_>) -> Result<()>,
    ) -> Result<()> {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        before(&mut encoder);
        let first = 2 * self.stages.len() as u32;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(stage),
            timestamp_writes: self.queries.as_ref().map(|(set, _)| wgpu::ComputePassTimestampWrites {
                query_set: set,
                beginning_of_pass_write_index: Some(first),
                end_of_pass_write_index: Some(first + 1),
            }),
        });
        record(&mut pass)?;
        drop(pass);
        self.submit(gpu, stage, encoder)
    }

    /// Records a render pass into `targets` and `depth` that counts as `stage`, and submits it.
    pub(crate) fn draw(
        &mut self,
        gpu: &Gpu,
        stage: &'static str,
        targets: &[Option<wgpu::RenderPassColorAttachment<'_>>],
        depth: Option<wgpu::RenderPassDepthStencilAttachment<'_>>,
        record: impl FnOnce(&mut wgpu::RenderPass<'_>) -> Result<()>,
    ) -> Result<()> {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let first = 2 * self.stages.len() as u32;
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(stage),
            color_attachments: targets,
            depth_stencil_attachment: depth,
            timestamp_writes: self.queries.as_ref().map(|(set, _)| wgpu::RenderPassTimestampWrites {
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

    fn submit(&mut self, gpu: &Gpu, stage: &'static str, encoder: wgpu::CommandEncoder) -> Result<()> {
        self.stages.push(stage);
        let start = Instant::now();
        gpu.queue.submit([encoder.finish()]);
        if self.queries.is_none() {
            gpu.wait()?;
            *self.wall.entry(stage).or_default() += start.elapsed().as_secs_f64() * 1e3;
        }
        gpu.check()
    }

    /// Milliseconds by stage.
    pub fn finish(self, gpu: &Gpu) -> Result<BTreeMap<&'static str, f64>> {
        let Some((set, buffer)) = self.queries else { return Ok(self.wall) };
        let count = 2 * self.stages.len() as u32;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.resolve_query_set(&set, 0..count, &buffer.raw, 0);
        gpu.queue.submit([encoder.finish()]);
        let ticks = buffer.read(gpu, u64::from(count))?;
        let period_ms = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
        let mut times = BTreeMap::new();
        for (stage, pair) in self.stages.iter().zip(ticks.chunks_exact(2)) {
            *times.entry(*stage).or_default() += pair[1].saturating_sub(pair[0]) as f64 * period_ms;
        }
        Ok(times)
    }
}
