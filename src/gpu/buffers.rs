//! Device buffers: checked against the limits, written and read back in bounded pieces.

use std::borrow::Cow;
use std::marker::PhantomData;
use std::ops::Range;

use bytemuck::Pod;

use super::device::Gpu;
use super::traffic::Traffic;
use crate::error::{Error, Result};
use crate::progress::Progress;

/// Bytes copied per submission, in either direction; bounds the staging memory.
pub(super) const PIECE: u64 = 32 << 20;

/// Bytes per piece if the host writes a mapped buffer directly. Two pieces are in host memory at a
/// time, and the allocator reuses their memory for the next ones.
const OPEN_PIECE: usize = 1 << 20;

/// A device buffer with elements of type `T`.
pub struct Buffer<T> {
    pub(crate) raw: wgpu::Buffer,
    /// Number of elements.
    pub len: u64,
    element: PhantomData<T>,
}

impl<T: Pod> Buffer<T> {
    /// Creates a storage buffer of `len` zero elements. `what` names it in an error.
    pub fn storage(gpu: &Gpu, what: &str, len: u64) -> Result<Self> {
        Self::create(gpu, what, len, wgpu::BufferUsages::STORAGE, gpu.buffer_limit())
    }

    /// Creates a storage buffer that the host can map and read directly, if the device supports
    /// that ([`Readback`]).
    pub(crate) fn readable(gpu: &Gpu, what: &str, len: u64) -> Result<Self> {
        Self::open(gpu, what, len, (wgpu::BufferUsages::MAP_READ, wgpu::BufferUsages::empty()))
    }

    /// Creates a storage buffer that the host can map and write directly, if the device supports
    /// that ([`write`](Self::write)).
    pub(crate) fn writable(gpu: &Gpu, what: &str, len: u64) -> Result<Self> {
        Self::open(gpu, what, len, (wgpu::BufferUsages::MAP_WRITE, wgpu::BufferUsages::empty()))
    }

    /// Creates a storage buffer that the host can map, read and write directly, if the device
    /// supports that. It can also hold the arguments of indirect dispatches.
    pub(crate) fn exchanged(gpu: &Gpu, what: &str, len: u64) -> Result<Self> {
        let maps = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::MAP_WRITE;
        Self::open(gpu, what, len, (maps, wgpu::BufferUsages::INDIRECT))
    }

    /// Creates a storage buffer of these `others` usages, which also has the usages `maps` if the
    /// device can map storage buffers.
    fn open(gpu: &Gpu, what: &str, len: u64, (maps, others): (wgpu::BufferUsages, wgpu::BufferUsages)) -> Result<Self> {
        // On a card, memory that the host maps is slow for kernels.
        let can_lie_open = gpu.device.features().contains(wgpu::Features::MAPPABLE_PRIMARY_BUFFERS);
        let lies_open = can_lie_open && gpu.adapter.is_software();
        let maps = if lies_open { maps } else { wgpu::BufferUsages::empty() };
        Self::create(gpu, what, len, wgpu::BufferUsages::STORAGE | others | maps, gpu.buffer_limit())
    }

    /// Creates a storage buffer that can also hold the arguments of indirect dispatches.
    pub fn indirect(gpu: &Gpu, what: &str, len: u64) -> Result<Self> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::INDIRECT;
        Self::create(gpu, what, len, usage, gpu.buffer_limit())
    }

    /// Creates a uniform buffer of one element.
    pub fn uniform(gpu: &Gpu, what: &str, value: &T) -> Result<Self> {
        let limit = gpu.adapter.max_uniform_buffer_binding_size;
        let buffer = Self::create(gpu, what, 1, wgpu::BufferUsages::UNIFORM, limit)?;
        buffer.set(gpu, value);
        Ok(buffer)
    }

    /// Reinterprets this buffer as u32 words.
    pub(crate) fn words(self) -> Buffer<u32> {
        let len = self.raw.size() / 4;
        Buffer { raw: self.raw, len, element: PhantomData }
    }

    /// Returns the whole buffer as a binding.
    pub(crate) fn bound(&self) -> wgpu::BindingResource<'_> {
        self.raw.as_entire_binding()
    }

    /// Size in device memory, bytes.
    pub fn bytes(&self) -> u64 {
        self.raw.size()
    }

    /// Grows the buffer to `len` elements and keeps the contents. `what` names it in an error.
    /// Waits for the copy, so that the old and the new buffer exist together only briefly.
    pub(crate) fn grow(&mut self, gpu: &Gpu, what: &str, len: u64) -> Result<()> {
        let new = Self::create(gpu, what, len, self.raw.usage(), gpu.buffer_limit())?;
        let mut encoder = gpu.encoder();
        encoder.copy_buffer_to_buffer(&self.raw, 0, &new.raw, 0, self.raw.size().min(new.raw.size()));
        gpu.submit(encoder);
        *self = new;
        gpu.wait()
    }

    /// Overwrites the first element.
    pub fn set(&self, gpu: &Gpu, value: &T) {
        self.put(gpu, bytemuck::bytes_of(value));
    }

    /// Overwrites the first bytes.
    pub(crate) fn put(&self, gpu: &Gpu, bytes: &[u8]) {
        Traffic::count(Traffic { bytes_written: bytes.len() as u64, ..Traffic::default() });
        gpu.queue.write_buffer(&self.raw, 0, bytes);
    }

    fn create(gpu: &Gpu, what: &str, len: u64, usage: wgpu::BufferUsages, limit: u64) -> Result<Self> {
        // wgpu rejects empty bindings.
        let len = len.max(1);
        let size = len.saturating_mul(size_of::<T>() as u64);
        // Rounds up to 8 bytes, because words_long.wgsl reads 64-bit words.
        let size = size.checked_next_multiple_of(8).unwrap_or(size);
        if size > limit {
            let storage = usage.contains(wgpu::BufferUsages::STORAGE);
            return Err(Error::Limit {
                adapter: gpu.adapter.name.clone(),
                limit: match storage {
                    true if gpu.adapter.max_buffer_size < gpu.adapter.max_storage_buffer_binding_size => {
                        "max_buffer_size"
                    }
                    true => "max_storage_buffer_binding_size",
                    false => "max_uniform_buffer_binding_size",
                },
                available: limit,
                needed: size,
                what: format!("for {what}; choose a smaller image or another adapter"),
            });
        }
        let guard = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let raw = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size,
            usage: usage | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        if pollster::block_on(guard.pop()).is_some() {
            return Err(
                gpu.error(format!("out of memory for {what} ({size} bytes): use fewer surfels or a smaller image"))
            );
        }
        gpu.check()?;
        Ok(Self { raw, len, element: PhantomData })
    }

    /// Overwrites the first `len` elements. `values` returns the elements of a range.
    pub fn write<'a>(
        &self,
        gpu: &Gpu,
        len: usize,
        values: impl Fn(Range<usize>) -> Cow<'a, [T]> + Sync,
        progress: &dyn Progress,
    ) -> Result<()>
    where
        T: Send + Sync,
    {
        if len > 0 && self.raw.usage().contains(wgpu::BufferUsages::MAP_WRITE) {
            return self.write_where_it_lies(gpu, len, values, progress);
        }
        let per_piece = (PIECE / size_of::<T>() as u64).max(1) as usize;
        for first in (0..len).step_by(per_piece) {
            let values = values(first..len.min(first + per_piece));
            let bytes: &[u8] = bytemuck::cast_slice(&values);
            Traffic::count(Traffic { bytes_written: bytes.len() as u64, ..Traffic::default() });
            gpu.queue.write_buffer(&self.raw, (first * size_of::<T>()) as u64, bytes);
            // Submitting and waiting frees the staging memory of this piece.
            gpu.submit(gpu.encoder());
            gpu.wait()?;
            progress.advance(values.len() as u64);
        }
        Ok(())
    }

    /// Writes through a mapping. The next piece is computed while one is copied, because the copy
    /// is slow where it touches device memory for the first time.
    fn write_where_it_lies<'a>(
        &self,
        gpu: &Gpu,
        len: usize,
        values: impl Fn(Range<usize>) -> Cow<'a, [T]> + Sync,
        progress: &dyn Progress,
    ) -> Result<()>
    where
        T: Send + Sync,
    {
        let size = size_of::<T>();
        let per_piece = (OPEN_PIECE / size).max(1);
        let slice = self.raw.slice(..((len * size) as u64).next_multiple_of(4));
        slice.map_async(wgpu::MapMode::Write, |_| {});
        gpu.wait()?;
        let mut view = slice.get_mapped_range_mut().map_err(|e| gpu.error(format!("writing failed: {e}")))?;
        let piece = |first: usize| values(first..len.min(first + per_piece));
        let mut next = piece(0);
        for first in (0..len).step_by(per_piece) {
            let these = std::mem::take(&mut next);
            rayon::in_place_scope(|scope| {
                if first + per_piece < len {
                    scope.spawn(|_| next = piece(first + per_piece));
                }
                let bytes: &[u8] = bytemuck::cast_slice(&these);
                view.slice(first * size..first * size + bytes.len()).copy_from_slice(bytes);
                Traffic::count(Traffic { bytes_written: bytes.len() as u64, ..Traffic::default() });
            });
            progress.advance(these.len() as u64);
        }
        drop(view);
        self.raw.unmap();
        gpu.check()
    }

    /// Reads the first `len` elements.
    pub fn read(&self, gpu: &Gpu, len: u64) -> Result<Vec<T>> {
        let len = len.min(self.len);
        let mut values: Vec<T> = Vec::with_capacity(len as usize);
        let bytes = len * size_of::<T>() as u64;
        Readback::new(gpu, self, bytes, size_of::<T>() as u64).visit(gpu, self, bytes, |bytes| {
            // A mapped range need not be aligned for T, so elements are copied bytewise.
            values.extend(bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned::<T>));
        })?;
        Ok(values)
    }
}

/// Reads a buffer back in pieces: through a staging buffer, or directly if the host can map the
/// buffer itself.
pub(crate) struct Readback {
    staging: Option<wgpu::Buffer>,
    step: u64,
}

impl Readback {
    /// Creates a readback of up to `bytes` of `buffer`, in pieces of whole records of `record`
    /// bytes.
    pub(crate) fn new<T>(gpu: &Gpu, buffer: &Buffer<T>, bytes: u64, record: u64) -> Self {
        let step = bytes.min((PIECE / record).max(1) * record).next_multiple_of(4).max(4);
        let read = wgpu::BufferUsages::MAP_READ;
        let staging = (!buffer.raw.usage().contains(read)).then(|| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("readback"),
                size: step,
                usage: read | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        });
        Self { staging, step }
    }

    /// Size of the staging memory, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.staging.as_ref().map_or(0, wgpu::Buffer::size)
    }

    /// Records the copy of the piece of the first `bytes` of `buffer` that starts at `offset`.
    /// Returns what the host maps to read the piece.
    fn record<'a>(
        &'a self,
        encoder: &mut wgpu::CommandEncoder,
        buffer: &'a wgpu::Buffer,
        (offset, bytes): (u64, u64),
    ) -> wgpu::BufferSlice<'a> {
        match &self.staging {
            Some(staging) => {
                let size = (bytes - offset).min(self.step);
                encoder.copy_buffer_to_buffer(buffer, offset, staging, 0, size);
                staging.slice(..size)
            }
            None => buffer.slice(..bytes),
        }
    }

    /// Calls `piece` with the bytes of each piece of the first `bytes` of `buffer`, in order.
    pub(crate) fn visit<T>(
        &self,
        gpu: &Gpu,
        buffer: &Buffer<T>,
        bytes: u64,
        mut piece: impl FnMut(&[u8]),
    ) -> Result<()> {
        let image = Image { readback: self, buffer: &buffer.raw, bytes, piece: &mut piece };
        read(gpu, gpu.encoder(), &[], Some(image)).map(|_| ())
    }
}

/// The start of a buffer that the host reads in pieces.
pub(crate) struct Image<'a> {
    /// The staging memory.
    pub readback: &'a Readback,
    /// The buffer.
    pub buffer: &'a wgpu::Buffer,
    /// The number of bytes to read.
    pub bytes: u64,
    /// Takes each piece, in order.
    pub piece: &'a mut dyn FnMut(&[u8]),
}

/// Some 64-bit words of a buffer.
pub(crate) struct Words<'a> {
    /// The buffer.
    pub buffer: &'a wgpu::Buffer,
    /// The byte at which the first word starts.
    pub first: u64,
    /// The number of words.
    pub count: u64,
}

/// Submits the commands of `encoder`, and reads `words` and `image` after them. Waits for the
/// device once, and once more for each further piece of the image.
pub(super) fn read(
    gpu: &Gpu,
    mut encoder: wgpu::CommandEncoder,
    words: &[Words<'_>],
    image: Option<Image<'_>>,
) -> Result<Vec<u64>> {
    let count: u64 = words.iter().map(|words| words.count).sum();
    let tray = (count > 0).then(|| gpu.spare.tray(gpu, 8 * count));
    let mut place = 0;
    for words in words {
        if let Some(tray) = &tray {
            encoder.copy_buffer_to_buffer(words.buffer, words.first, tray, place, 8 * words.count);
        }
        place += 8 * words.count;
    }
    let bytes = image.as_ref().map_or(0, |image| image.bytes.min(image.buffer.size()));
    let first = image.as_ref().filter(|_| bytes > 0);
    let first = first.map(|image| image.readback.record(&mut encoder, image.buffer, (0, bytes)));
    gpu.submit(encoder);
    let tray_slice = tray.as_ref().map(|tray| tray.slice(..8 * count));
    map(gpu, tray_slice.into_iter().chain(first))?;
    let mut values = Vec::new();
    if let Some(slice) = tray_slice {
        values = mapped(gpu, slice, |bytes| bytes.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect())
            .inspect_err(|_| first.into_iter().for_each(|slice| slice.buffer().unmap()))?;
    }
    tray.into_iter().for_each(|tray| gpu.spare.keep(tray));
    let (Some(image), Some(mut slice)) = (image, first) else { return Ok(values) };
    let mut offset = 0;
    loop {
        offset += mapped(gpu, slice, |bytes| {
            (image.piece)(bytes);
            bytes.len() as u64
        })?;
        if offset >= bytes {
            return Ok(values);
        }
        let mut encoder = gpu.encoder();
        slice = image.readback.record(&mut encoder, image.buffer, (offset, bytes));
        gpu.submit(encoder);
        map(gpu, std::iter::once(slice))?;
    }
}

/// Maps slices and waits until the host can read them. After an error, none is mapped.
fn map<'a>(gpu: &Gpu, slices: impl Iterator<Item = wgpu::BufferSlice<'a>> + Clone) -> Result<()> {
    gpu.check()?;
    slices.clone().for_each(|slice| slice.map_async(wgpu::MapMode::Read, |_| {}));
    gpu.wait().inspect_err(|_| slices.for_each(|slice| slice.buffer().unmap()))
}

/// Returns what `of` makes of the bytes of a mapped slice, and unmaps it.
fn mapped<R>(gpu: &Gpu, slice: wgpu::BufferSlice<'_>, of: impl FnOnce(&[u8]) -> R) -> Result<R> {
    let view = slice.get_mapped_range().map_err(|e| gpu.error(format!("reading back failed: {e}")))?;
    Traffic::count(Traffic { bytes_read: view.len() as u64, ..Traffic::default() });
    let made = of(&view);
    drop(view);
    slice.buffer().unmap();
    Ok(made)
}
