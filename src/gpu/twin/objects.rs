//! The objects of the twin's device: buffers, modules and bindings, and those that do nothing.

use std::ops::Range;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use naga::Module;
use naga::valid::ModuleInfo;
use wgpu::custom as api;

/// A buffer in the processor's memory. Workgroups write to it from several threads.
#[derive(Clone, Debug, Default)]
pub(super) struct Buffer(pub Arc<[AtomicU32]>);

impl Buffer {
    pub fn new(bytes: u64) -> Self {
        Self((0..bytes.div_ceil(4)).map(|_| AtomicU32::new(0)).collect())
    }

    /// Copies words from this one on.
    pub fn words(&self, range: Range<usize>) -> Vec<u32> {
        self.0[range].iter().map(|word| word.load(Relaxed)).collect()
    }

    /// Writes words from this one on.
    pub fn write(&self, first: usize, words: impl IntoIterator<Item = u32>) {
        self.0[first..].iter().zip(words).for_each(|(held, word)| held.store(word, Relaxed));
    }
}

impl api::BufferInterface for Buffer {
    fn map_async(&self, _: wgpu::MapMode, _: Range<u64>, callback: api::BufferMapCallback) {
        callback(Ok(()));
    }

    fn get_mapped_range(&self, range: Range<u64>) -> Result<api::DispatchBufferMappedRange, wgpu::MapRangeError> {
        let words = self.words(range.start as usize / 4..(range.end as usize).div_ceil(4));
        let bytes = bytemuck::cast_slice(&words)[..(range.end - range.start) as usize].to_vec();
        let (buffer, first) = (self.clone(), range.start as usize / 4);
        Ok(api::DispatchBufferMappedRange::custom(Bytes { bytes, buffer, first, written: false }))
    }

    fn unmap(&self) {}

    fn destroy(&self) {}
}

/// A copy of a buffer's bytes, which go back to the buffer once they were written.
#[derive(Debug)]
struct Bytes {
    bytes: Vec<u8>,
    buffer: Buffer,
    /// The first of their words in the buffer.
    first: usize,
    written: bool,
}

impl Drop for Bytes {
    fn drop(&mut self) {
        if self.written {
            self.buffer.write(self.first, bytemuck::pod_collect_to_vec::<u8, u32>(&self.bytes));
        }
    }
}

impl api::BufferMappedRangeInterface for Bytes {
    fn len(&self) -> usize {
        self.bytes.len()
    }

    #[allow(unsafe_code)]
    unsafe fn read_slice(&self) -> &[u8] {
        &self.bytes
    }

    #[allow(unsafe_code)]
    unsafe fn write_slice(&mut self) -> wgpu::WriteOnly<'_, [u8]> {
        self.written = true;
        (&mut self.bytes[..]).into()
    }
}

/// A module, valid or with the reason why it is not.
#[derive(Clone, Debug)]
pub(super) struct Kernels(pub Arc<Result<(Module, ModuleInfo), String>>);

impl api::ShaderModuleInterface for Kernels {
    fn get_compilation_info(&self) -> Pin<Box<dyn api::ShaderCompilationInfoFuture>> {
        Box::pin(std::future::ready(wgpu::CompilationInfo { messages: Vec::new() }))
    }
}

/// A kernel to dispatch.
#[derive(Clone, Debug)]
pub(super) struct Pipeline {
    pub kernels: Kernels,
    pub entry: String,
}

impl api::ComputePipelineInterface for Pipeline {
    fn get_bind_group_layout(&self, _: u32) -> api::DispatchBindGroupLayout {
        api::DispatchBindGroupLayout::custom(Nothing)
    }
}

/// A range of a buffer, in words, that a variable binds.
#[derive(Clone, Debug)]
pub(super) struct Bound {
    pub binding: u32,
    pub buffer: Buffer,
    pub words: Range<usize>,
}

/// The bound buffers of a dispatch.
#[derive(Clone, Debug)]
pub(super) struct Group(pub Vec<Bound>);

impl api::BindGroupInterface for Group {}

/// An object without a function here: layouts, and what only rasterisers use.
#[derive(Debug)]
pub(super) struct Nothing;

impl api::BindGroupLayoutInterface for Nothing {}
impl api::PipelineLayoutInterface for Nothing {}
impl api::SamplerInterface for Nothing {}
impl api::TextureViewInterface for Nothing {}
impl api::TlasInterface for Nothing {}

impl api::TextureInterface for Nothing {
    fn create_view(&self, _: &wgpu::TextureViewDescriptor<'_>) -> api::DispatchTextureView {
        api::DispatchTextureView::custom(Self)
    }

    fn destroy(&self) {}
}

impl api::ExternalTextureInterface for Nothing {
    fn destroy(&self) {}
}

impl api::BlasInterface for Nothing {
    fn prepare_compact_async(&self, callback: api::BlasCompactCallback) {
        callback(Ok(()));
    }

    fn ready_for_compaction(&self) -> bool {
        false
    }
}

impl api::QuerySetInterface for Nothing {
    fn destroy(&self) {}
}

impl api::RenderPipelineInterface for Nothing {
    fn get_bind_group_layout(&self, _: u32) -> api::DispatchBindGroupLayout {
        api::DispatchBindGroupLayout::custom(Self)
    }
}

impl api::PipelineCacheInterface for Nothing {
    fn get_data(&self) -> Option<Vec<u8>> {
        None
    }
}
