//! The twin as a device of wgpu: the renderer drives it as it drives any other.

use std::collections::BTreeMap;
use std::pin::Pin;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, ThreadId};

use naga::valid::Capabilities;
use wgpu::custom as api;

use super::commands::{Command, Encoder, Finished, Grid};
use super::objects::{Bound, Buffer, Group, Kernels, Nothing, Pipeline};
use super::raster::NoRaster;
use super::tally::Tally;
use crate::gpu::interface::Interface;

/// Errors until somebody asks for them.
#[derive(Default)]
struct Errors {
    handler: Option<Arc<dyn wgpu::UncapturedErrorHandler>>,
    /// The open scopes, by their numbers.
    scopes: BTreeMap<u32, Scope>,
}

/// An error scope, which belongs to a thread, and the first error in it.
struct Scope {
    thread: ThreadId,
    error: Option<wgpu::Error>,
}

/// The device and its queue.
#[derive(Clone, Default)]
pub(super) struct Device {
    errors: Arc<Mutex<Errors>>,
    done: Arc<Mutex<Tally>>,
}

impl std::fmt::Debug for Device {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str("the f32 twin")
    }
}

impl Device {
    fn fail(&self, description: String) {
        let error = wgpu::Error::Validation { source: description.clone().into(), description };
        let handler = {
            let mut errors = self.errors.lock().unwrap_or_else(PoisonError::into_inner);
            let own = |scope: &&mut Scope| scope.thread == thread::current().id();
            if let Some(scope) = errors.scopes.values_mut().rev().find(own) {
                scope.error.get_or_insert(error);
                return;
            }
            errors.handler.clone()
        };
        if let Some(handler) = handler {
            handler(error);
        }
    }

    fn lacks(&self, what: &str) {
        self.fail(format!("the f32 twin has no {what}"));
    }

    /// Returns what the kernels have done since the last call.
    pub(super) fn tally(&self) -> Tally {
        std::mem::take(&mut *self.done.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Runs a command.
    fn run(&self, command: Command) -> Result<(), String> {
        match command {
            Command::Copy { from: (from, first), into: (into, place), words } => {
                let end = words.map_or(from.0.len(), |words| first + words);
                into.write(place, from.words(first..end));
                Ok(())
            }
            Command::Clear { buffer, first, words } => {
                buffer.write(first, std::iter::repeat_n(0, words.unwrap_or(buffer.0.len())));
                Ok(())
            }
            Command::Dispatch { pipeline, bound, grid } => {
                let grid = match grid {
                    Grid::Of(grid) => grid,
                    Grid::In(buffer, at) => [0, 1, 2].map(|k| buffer.0[at + k].load(Relaxed)),
                };
                let done = super::dispatch(&pipeline, &bound, grid)?;
                let mut tally = self.done.lock().unwrap_or_else(PoisonError::into_inner);
                let so_far = tally.remove(&pipeline.entry).unwrap_or_default();
                tally.insert(pipeline.entry.clone(), so_far.and(done));
                Ok(())
            }
            Command::Fail(what) => Err(format!("the f32 twin has no {what}")),
        }
    }
}

impl api::DeviceInterface for Device {
    fn features(&self) -> wgpu::Features {
        wgpu::Features::empty()
    }

    fn limits(&self) -> wgpu::Limits {
        wgpu::Limits::default()
    }

    fn adapter_info(&self) -> wgpu::AdapterInfo {
        wgpu::AdapterInfo::new(wgpu::DeviceType::Cpu, wgpu::Backend::Noop)
    }

    fn create_shader_module(
        &self,
        desc: wgpu::ShaderModuleDescriptor<'_>,
        _: wgpu::ShaderRuntimeChecks,
    ) -> api::DispatchShaderModule {
        let read = match desc.source {
            wgpu::ShaderSource::Wgsl(text) => Interface::of(&text, Capabilities::empty())
                .map(|interface| (interface.module, interface.info))
                .map_err(|invalid| invalid.told(|line| Some(("line", line)))),
            _ => Err("the f32 twin reads WGSL alone".to_owned()),
        };
        if let Err(error) = &read {
            self.fail(error.clone());
        }
        api::DispatchShaderModule::custom(Kernels(Arc::new(read)))
    }

    #[allow(unsafe_code)]
    unsafe fn create_shader_module_passthrough(
        &self,
        _: &wgpu::ShaderModuleDescriptorPassthrough<'_>,
    ) -> api::DispatchShaderModule {
        self.lacks("SPIR-V");
        api::DispatchShaderModule::custom(Kernels(Arc::new(Err("the f32 twin has no SPIR-V".into()))))
    }

    fn create_bind_group_layout(&self, _: &wgpu::BindGroupLayoutDescriptor<'_>) -> api::DispatchBindGroupLayout {
        api::DispatchBindGroupLayout::custom(Nothing)
    }

    fn create_bind_group(&self, desc: &wgpu::BindGroupDescriptor<'_>) -> api::DispatchBindGroup {
        let bound = desc.entries.iter().filter_map(|entry| {
            let wgpu::BindingResource::Buffer(part) = &entry.resource else { return None };
            let buffer = part.buffer.as_custom::<Buffer>()?.clone();
            let first = part.offset as usize / 4;
            let end = part.size.map_or(buffer.0.len(), |bytes| first + bytes.get() as usize / 4);
            let words = first..end.min(buffer.0.len());
            Some(Bound { binding: entry.binding, buffer, words })
        });
        let bound: Vec<_> = bound.collect();
        if bound.len() < desc.entries.len() {
            self.lacks("textures");
        }
        api::DispatchBindGroup::custom(Group(bound))
    }

    fn create_pipeline_layout(&self, _: &wgpu::PipelineLayoutDescriptor<'_>) -> api::DispatchPipelineLayout {
        api::DispatchPipelineLayout::custom(Nothing)
    }

    fn create_render_pipeline(&self, _: &wgpu::RenderPipelineDescriptor<'_>) -> api::DispatchRenderPipeline {
        self.lacks("rasteriser");
        api::DispatchRenderPipeline::custom(Nothing)
    }

    fn create_mesh_pipeline(&self, _: &wgpu::MeshPipelineDescriptor<'_>) -> api::DispatchRenderPipeline {
        self.lacks("rasteriser");
        api::DispatchRenderPipeline::custom(Nothing)
    }

    fn create_compute_pipeline(&self, desc: &wgpu::ComputePipelineDescriptor<'_>) -> api::DispatchComputePipeline {
        let unread = || Kernels(Arc::new(Err("a module of another device".into())));
        let kernels = desc.module.as_custom::<Kernels>().cloned().unwrap_or_else(unread);
        let entry = desc.entry_point.unwrap_or_default().to_owned();
        api::DispatchComputePipeline::custom(Pipeline { kernels, entry })
    }

    #[allow(unsafe_code)]
    unsafe fn create_pipeline_cache(&self, _: &wgpu::PipelineCacheDescriptor<'_>) -> api::DispatchPipelineCache {
        api::DispatchPipelineCache::custom(Nothing)
    }

    fn create_buffer(&self, desc: &wgpu::BufferDescriptor<'_>) -> api::DispatchBuffer {
        api::DispatchBuffer::custom(Buffer::new(desc.size))
    }

    fn create_texture(&self, _: &wgpu::TextureDescriptor<'_>) -> api::DispatchTexture {
        self.lacks("textures");
        api::DispatchTexture::custom(Nothing)
    }

    fn create_external_texture(
        &self,
        _: &wgpu::ExternalTextureDescriptor<'_>,
        _: &[&wgpu::TextureView],
    ) -> api::DispatchExternalTexture {
        self.lacks("textures");
        api::DispatchExternalTexture::custom(Nothing)
    }

    fn create_blas(
        &self,
        _: &wgpu::CreateBlasDescriptor<'_>,
        _: wgpu::BlasGeometrySizeDescriptors,
    ) -> (Option<u64>, api::DispatchBlas) {
        self.lacks("acceleration structures");
        (None, api::DispatchBlas::custom(Nothing))
    }

    fn create_tlas(&self, _: &wgpu::CreateTlasDescriptor<'_>) -> api::DispatchTlas {
        self.lacks("acceleration structures");
        api::DispatchTlas::custom(Nothing)
    }

    fn create_sampler(&self, _: &wgpu::SamplerDescriptor<'_>) -> api::DispatchSampler {
        self.lacks("samplers");
        api::DispatchSampler::custom(Nothing)
    }

    fn create_query_set(&self, _: &wgpu::QuerySetDescriptor<'_>) -> api::DispatchQuerySet {
        self.lacks("queries");
        api::DispatchQuerySet::custom(Nothing)
    }

    fn create_command_encoder(&self, _: &wgpu::CommandEncoderDescriptor<'_>) -> api::DispatchCommandEncoder {
        api::DispatchCommandEncoder::custom(Encoder::default())
    }

    fn create_render_bundle_encoder(
        &self,
        _: &wgpu::RenderBundleEncoderDescriptor<'_>,
    ) -> api::DispatchRenderBundleEncoder {
        self.lacks("rasteriser");
        api::DispatchRenderBundleEncoder::custom(NoRaster)
    }

    fn set_device_lost_callback(&self, _: api::BoxDeviceLostCallback) {}

    fn on_uncaptured_error(&self, handler: Arc<dyn wgpu::UncapturedErrorHandler>) {
        self.errors.lock().unwrap_or_else(PoisonError::into_inner).handler = Some(handler);
    }

    fn push_error_scope(&self, _: wgpu::ErrorFilter) -> u32 {
        let scopes = &mut self.errors.lock().unwrap_or_else(PoisonError::into_inner).scopes;
        let number = scopes.keys().next_back().map_or(0, |last| last + 1);
        scopes.insert(number, Scope { thread: thread::current().id(), error: None });
        number
    }

    fn pop_error_scope(&self, index: u32) -> Pin<Box<dyn api::PopErrorScopeFuture>> {
        let scope = self.errors.lock().unwrap_or_else(PoisonError::into_inner).scopes.remove(&index);
        let error = scope.and_then(|scope| scope.error);
        Box::pin(std::future::ready(error))
    }

    #[allow(unsafe_code)]
    unsafe fn start_graphics_debugger_capture(&self) {}

    #[allow(unsafe_code)]
    unsafe fn stop_graphics_debugger_capture(&self) {}

    fn poll(&self, _: wgpu::wgt::PollType<u64>) -> Result<wgpu::PollStatus, wgpu::PollError> {
        // Commands are run when they are submitted.
        Ok(wgpu::PollStatus::QueueEmpty)
    }

    fn get_internal_counters(&self) -> wgpu::InternalCounters {
        wgpu::InternalCounters::default()
    }

    fn generate_allocator_report(&self) -> Option<wgpu::AllocatorReport> {
        None
    }

    fn destroy(&self) {}
}

impl api::QueueInterface for Device {
    fn write_buffer(&self, buffer: &api::DispatchBuffer, offset: u64, data: &[u8]) {
        if let Some(buffer) = buffer.as_custom::<Buffer>() {
            // WebGPU: offsets and sizes of writes are multiples of 4.
            buffer.write(offset as usize / 4, bytemuck::pod_collect_to_vec::<u8, u32>(data));
        }
    }

    fn create_staging_buffer(&self, _: wgpu::BufferSize) -> Option<api::DispatchQueueWriteBuffer> {
        None
    }

    fn validate_write_buffer(&self, _: &api::DispatchBuffer, _: u64, _: wgpu::BufferSize) -> Option<()> {
        Some(())
    }

    fn write_staging_buffer(&self, _: &api::DispatchBuffer, _: u64, _: &api::DispatchQueueWriteBuffer) {}

    fn write_texture(
        &self,
        _: wgpu::TexelCopyTextureInfo<'_>,
        _: &[u8],
        _: wgpu::TexelCopyBufferLayout,
        _: wgpu::Extent3d,
    ) {
        self.lacks("textures");
    }

    fn submit(&self, buffers: &mut dyn Iterator<Item = api::DispatchCommandBuffer>) -> u64 {
        for buffer in buffers {
            let commands = buffer.as_custom::<Finished>().map(Finished::take).unwrap_or_default();
            for command in commands {
                if let Err(error) = self.run(command) {
                    self.fail(error);
                }
            }
        }
        0
    }

    fn get_timestamp_period(&self) -> f32 {
        1.0
    }

    fn on_submitted_work_done(&self, callback: api::BoxSubmittedWorkDoneCallback) {
        callback();
    }

    fn compact_blas(&self, _: &api::DispatchBlas) -> (Option<u64>, api::DispatchBlas) {
        self.lacks("acceleration structures");
        (None, api::DispatchBlas::custom(Nothing))
    }

    fn present(&self, _: &api::DispatchSurfaceOutputDetail) {}
}
