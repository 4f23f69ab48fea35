//! Commands: recorded by encoders, run in their order by the queue.

use std::sync::{Arc, Mutex, PoisonError};

use wgpu::custom as api;

use super::objects::{Bound, Buffer, Group, Pipeline};

/// The workgroups of a dispatch.
#[derive(Clone, Debug)]
pub(super) enum Grid {
    Of([u32; 3]),
    /// The three words of a buffer from this one on.
    In(Buffer, usize),
}

#[derive(Debug)]
pub(super) enum Command {
    /// Copies words from one buffer to another.
    Copy {
        from: (Buffer, usize),
        into: (Buffer, usize),
        words: Option<usize>,
    },
    /// Sets words to 0.
    Clear {
        buffer: Buffer,
        first: usize,
        words: Option<usize>,
    },
    Dispatch {
        pipeline: Pipeline,
        bound: Vec<Bound>,
        grid: Grid,
    },
    /// The twin cannot do what was asked.
    Fail(&'static str),
}

/// Commands that an encoder and its passes record.
type Recorded = Arc<Mutex<Vec<Command>>>;

fn record(recorded: &Recorded, command: Command) {
    // A panic leaves the commands as they are.
    recorded.lock().unwrap_or_else(PoisonError::into_inner).push(command);
}

#[derive(Debug, Default)]
pub(super) struct Encoder(Recorded);

/// The commands of an encoder that is finished.
#[derive(Debug)]
pub(super) struct Finished(Recorded);

impl Finished {
    pub fn take(&self) -> Vec<Command> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl api::CommandBufferInterface for Finished {}

/// The twin's buffer behind one of wgpu.
fn own(buffer: &api::DispatchBuffer) -> Buffer {
    // All buffers of the device are the twin's.
    buffer.as_custom::<Buffer>().cloned().unwrap_or_default()
}

impl api::CommandEncoderInterface for Encoder {
    fn copy_buffer_to_buffer(
        &self,
        source: &api::DispatchBuffer,
        source_offset: u64,
        destination: &api::DispatchBuffer,
        destination_offset: u64,
        copy_size: Option<u64>,
    ) {
        let from = (own(source), source_offset as usize / 4);
        let into = (own(destination), destination_offset as usize / 4);
        record(&self.0, Command::Copy { from, into, words: copy_size.map(|bytes| bytes as usize / 4) });
    }

    fn copy_buffer_to_texture(
        &self,
        _: wgpu::TexelCopyBufferInfo<'_>,
        _: wgpu::TexelCopyTextureInfo<'_>,
        _: wgpu::Extent3d,
    ) {
        record(&self.0, Command::Fail("textures"));
    }

    fn copy_texture_to_buffer(
        &self,
        _: wgpu::TexelCopyTextureInfo<'_>,
        _: wgpu::TexelCopyBufferInfo<'_>,
        _: wgpu::Extent3d,
    ) {
        record(&self.0, Command::Fail("textures"));
    }

    fn copy_texture_to_texture(
        &self,
        _: wgpu::TexelCopyTextureInfo<'_>,
        _: wgpu::TexelCopyTextureInfo<'_>,
        _: wgpu::Extent3d,
    ) {
        record(&self.0, Command::Fail("textures"));
    }

    fn begin_compute_pass(&self, _: &wgpu::ComputePassDescriptor<'_>) -> api::DispatchComputePass {
        let recorded = Arc::clone(&self.0);
        api::DispatchComputePass::custom(Pass { recorded, pipeline: None, bound: Vec::new() })
    }

    fn begin_render_pass(&self, _: &wgpu::RenderPassDescriptor<'_>) -> api::DispatchRenderPass {
        record(&self.0, Command::Fail("a rasteriser"));
        api::DispatchRenderPass::custom(super::raster::NoRaster)
    }

    fn finish(&mut self) -> api::DispatchCommandBuffer {
        api::DispatchCommandBuffer::custom(Finished(Arc::clone(&self.0)))
    }

    fn clear_texture(&self, _: &api::DispatchTexture, _: &wgpu::ImageSubresourceRange) {
        record(&self.0, Command::Fail("textures"));
    }

    fn clear_buffer(&self, buffer: &api::DispatchBuffer, offset: u64, size: Option<u64>) {
        let (first, words) = (offset as usize / 4, size.map(|bytes| bytes as usize / 4));
        record(&self.0, Command::Clear { buffer: own(buffer), first, words });
    }

    fn insert_debug_marker(&self, _: &str) {}

    fn push_debug_group(&self, _: &str) {}

    fn pop_debug_group(&self) {}

    fn write_timestamp(&self, _: &api::DispatchQuerySet, _: u32) {
        record(&self.0, Command::Fail("timestamps"));
    }

    fn resolve_query_set(&self, _: &api::DispatchQuerySet, _: u32, _: u32, _: &api::DispatchBuffer, _: u64) {
        record(&self.0, Command::Fail("timestamps"));
    }

    fn mark_acceleration_structures_built<'a>(
        &self,
        _: &mut dyn Iterator<Item = &'a wgpu::Blas>,
        _: &mut dyn Iterator<Item = &'a wgpu::Tlas>,
    ) {
        record(&self.0, Command::Fail("acceleration structures"));
    }

    fn build_acceleration_structures<'a>(
        &self,
        _: &mut dyn Iterator<Item = &'a wgpu::BlasBuildEntry<'a>>,
        _: &mut dyn Iterator<Item = &'a wgpu::Tlas>,
    ) {
        record(&self.0, Command::Fail("acceleration structures"));
    }

    fn transition_resources<'a>(
        &mut self,
        _: &mut dyn Iterator<Item = wgpu::wgt::BufferTransition<&'a api::DispatchBuffer>>,
        _: &mut dyn Iterator<Item = wgpu::wgt::TextureTransition<&'a api::DispatchTexture>>,
    ) {
    }
}

/// A compute pass under construction.
#[derive(Debug)]
struct Pass {
    recorded: Recorded,
    pipeline: Option<Pipeline>,
    bound: Vec<Bound>,
}

impl Pass {
    fn dispatch(&self, grid: Grid) {
        let command = match &self.pipeline {
            Some(pipeline) => Command::Dispatch { pipeline: pipeline.clone(), bound: self.bound.clone(), grid },
            None => Command::Fail("dispatches without a pipeline"),
        };
        record(&self.recorded, command);
    }
}

impl Drop for Pass {
    fn drop(&mut self) {}
}

impl api::ComputePassInterface for Pass {
    fn set_pipeline(&mut self, pipeline: &api::DispatchComputePipeline) {
        self.pipeline = pipeline.as_custom::<Pipeline>().cloned();
    }

    fn set_bind_group(&mut self, _: u32, group: Option<&api::DispatchBindGroup>, _: &[wgpu::DynamicOffset]) {
        let group = group.and_then(|group| group.as_custom::<Group>());
        self.bound = group.map(|group| group.0.clone()).unwrap_or_default();
    }

    fn set_immediates(&mut self, _: u32, _: &[u8]) {
        record(&self.recorded, Command::Fail("immediate data"));
    }

    fn insert_debug_marker(&mut self, _: &str) {}

    fn push_debug_group(&mut self, _: &str) {}

    fn pop_debug_group(&mut self) {}

    fn write_timestamp(&mut self, _: &api::DispatchQuerySet, _: u32) {
        record(&self.recorded, Command::Fail("timestamps"));
    }

    fn begin_pipeline_statistics_query(&mut self, _: &api::DispatchQuerySet, _: u32) {
        record(&self.recorded, Command::Fail("statistics of pipelines"));
    }

    fn end_pipeline_statistics_query(&mut self) {}

    fn dispatch_workgroups(&mut self, x: u32, y: u32, z: u32) {
        self.dispatch(Grid::Of([x, y, z]));
    }

    fn dispatch_workgroups_indirect(&mut self, buffer: &api::DispatchBuffer, offset: u64) {
        self.dispatch(Grid::In(own(buffer), offset as usize / 4));
    }

    fn transition_resources<'a>(
        &mut self,
        _: &mut dyn Iterator<Item = wgpu::wgt::BufferTransition<&'a api::DispatchBuffer>>,
        _: &mut dyn Iterator<Item = wgpu::wgt::TextureTransition<&'a api::DispatchTextureView>>,
    ) {
    }
}
