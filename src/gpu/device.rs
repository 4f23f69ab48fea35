//! The graphics device: owns wgpu's instance, limits and errors.

use std::sync::{Arc, Mutex, OnceLock};

use super::adapter::AdapterDescription;
use super::program::Compiled;
use super::spare::Spare;
use super::stored::{self, Stored};
use super::traffic::Traffic;
use super::twin;
use crate::error::{Error, Result};

/// Features that some kernels use where an adapter has them: 64-bit integers, f32 atomics and
/// subgroups.
const OF_KERNELS: wgpu::Features = wgpu::Features::SHADER_INT64
    .union(wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS)
    .union(wgpu::Features::SHADER_FLOAT32_ATOMIC)
    .union(wgpu::Features::SUBGROUP);

/// Features that are enabled where an adapter has them: those of kernels, timestamps, and blending
/// into 32-bit floats.
const OPTIONAL_FEATURES: wgpu::Features =
    OF_KERNELS.union(wgpu::Features::TIMESTAMP_QUERY).union(wgpu::Features::FLOAT32_BLENDABLE);

/// The feature that accepts kernels in SPIR-V (`spirv.rs`), which only Vulkan has.
fn of_spirv(adapter: &AdapterDescription) -> wgpu::Features {
    if adapter.api == "vulkan" { wgpu::Features::PASSTHROUGH_SHADERS } else { wgpu::Features::empty() }
}

/// Features that only software adapters use: the host maps their buffers directly. On a graphics
/// card, mappable buffers would lie in slow memory.
const SOFTWARE_FEATURES: wgpu::Features = wgpu::Features::MAPPABLE_PRIMARY_BUFFERS;

/// The features with which kernels and uploads are fastest on `adapter`.
pub(super) fn wanted_by_kernels(adapter: &AdapterDescription) -> wgpu::Features {
    let software = if adapter.is_software() { SOFTWARE_FEATURES } else { wgpu::Features::empty() };
    OF_KERNELS | software | of_spirv(adapter)
}

/// Advice for a missing adapter.
pub const INSTALL_HINT: &str = "install a Vulkan driver (on Debian or Ubuntu without a GPU: \
    apt-get install mesa-vulkan-drivers libvulkan1) or render with --backend reference, or with --adapter twin for the bits of an adapter";

/// Whether wgpu validates the workgroup counts of indirect dispatches.
///
/// Validation adds a dispatch before each indirect dispatch. This takes a fifth of the frame time
/// of small cuts of levels of detail (1.9 ms instead of 1.5). No workgroup count of the renderer is
/// too large. Grids that `rows_of` makes (`wgsl/project/project.wgsl`) are for lists shorter than
/// 2^30, so they have at most 65,535 groups per row and 2^14 rows. Grids that grow with a page's
/// queue have 128 groups per row and at most 2^15 rows. The others have one row per batch of a
/// page, and a page has at most [`MOST_GROUPS`](super::layout::MOST_GROUPS) batches. On Windows
/// validation stays on: Direct3D 12 passes the counts to kernels only if they are validated.
fn counts_are_checked() -> bool {
    cfg!(windows) || std::env::var_os("WGPU_VALIDATION_INDIRECT_CALL").is_some_and(|value| value != "0")
}

/// Returns the adapters of OpenGL, or those of all other APIs, best first.
fn enumerate(of_gl: bool) -> Vec<(AdapterDescription, wgpu::Adapter)> {
    // One instance for the whole run: NVIDIA's driver crashes if threads create and drop instances
    // concurrently (gfx-rs/wgpu#5930).
    static INSTANCES: [OnceLock<wgpu::Instance>; 2] = [const { OnceLock::new() }; 2];
    let backends = if of_gl { wgpu::Backends::GL } else { wgpu::Backends::all() - wgpu::Backends::GL };
    let instance = INSTANCES[usize::from(of_gl)].get_or_init(|| {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
        descriptor.backends &= backends;
        if !counts_are_checked() {
            descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
        }
        wgpu::Instance::new(descriptor)
    });
    let adapters = pollster::block_on(instance.enumerate_adapters(backends));
    let mut described: Vec<_> = adapters.into_iter().map(|a| (AdapterDescription::of(&a), a)).collect();
    described.sort_by_key(|(description, _)| description.rank());
    described
}

/// Lists all adapters, in the order in which `auto` prefers them. The environment variable
/// `WGPU_BACKEND` (vulkan, gl, ...) restricts them.
pub fn adapters() -> Vec<AdapterDescription> {
    let mut all: Vec<_> = [false, true].into_iter().flat_map(enumerate).map(|(description, _)| description).collect();
    all.sort_by_key(AdapterDescription::rank);
    all
}

/// Returns the best adapter of this name, and among equally good ones that of number `turn`, modulo
/// their number; see [`Gpu::open`].
fn best(name: Option<&str>, turn: usize) -> Result<(AdapterDescription, wgpu::Adapter)> {
    let wanted = |d: &AdapterDescription| d.usable && name.is_none_or(|name| d.is_meant_by(name));
    // OpenGL is tried last and only if needed: its libraries complain on stderr where there is no
    // display.
    let mut all = enumerate(false);
    if !all.iter().any(|(d, _)| wanted(d)) {
        all.extend(enumerate(true));
    }
    let known = all.iter().map(|(d, _)| format!("{} ({})", d.name, d.api)).collect::<Vec<_>>().join(", ");
    let kinds: Vec<_> = all.iter().map(|(d, _)| wanted(d).then_some((d.rank(), &*d.name, &*d.api))).collect();
    let chosen = in_turn(&kinds, turn);
    let chosen = chosen.map(|chosen| all.swap_remove(chosen));
    chosen.ok_or_else(|| {
        Error::NoAdapter(match (name, known.is_empty()) {
            (_, true) => format!("no graphics adapter was found: {INSTALL_HINT}"),
            (Some(name), false) => {
                format!("no usable adapter has the API or the name {name:?}; there are: {known}")
            }
            (None, false) => format!("no adapter can run compute kernels ({known}): {INSTALL_HINT}"),
        })
    })
}

/// The index of the adapter for the process of number `turn` on a machine: the first one in order,
/// or one of the same kind. None stands for an adapter that is not wanted.
fn in_turn<T: PartialEq>(kinds: &[Option<T>], turn: usize) -> Option<usize> {
    let first = kinds.iter().find(|kind| kind.is_some())?;
    let equal: Vec<usize> = (0..kinds.len()).filter(|index| kinds[*index] == *first).collect();
    Some(equal[turn % equal.len()])
}

/// An open device. Clones share the device and the cache of compiled kernels. They also share the
/// error that the device reported, such as its loss: only the first clone that checks gets the
/// error.
#[derive(Clone)]
pub struct Gpu {
    /// The adapter of the device.
    pub adapter: AdapterDescription,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) compiled: Arc<Compiled>,
    pub(super) spare: Arc<Spare>,
    failure: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens the best adapter, or the best among those that `name` selects. The name of an API
    /// (vulkan, gl or opengl, metal, dx12) selects its adapters, and `twin` selects the f32 twin,
    /// which needs no driver (`src/gpu/twin`). Any other name selects adapters whose names contain
    /// it. Case does not matter.
    ///
    /// # Errors
    /// [`Error::NoAdapter`] if no usable adapter matches, or [`Error::Gpu`] if the device cannot be
    /// opened.
    pub fn open(name: Option<&str>) -> Result<Self> {
        Self::open_in_turn(name, 0)
    }

    /// Opens the adapter of [`open`](Self::open), or another one of the same kind and name where a
    /// machine has several: number `turn` of them, modulo their number.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_in_turn(name: Option<&str>, turn: usize) -> Result<Self> {
        if name.is_some_and(|name| name.eq_ignore_ascii_case(twin::API)) {
            let (device, queue) = twin::open();
            return Ok(Self::watching(twin::adapter(), device, queue));
        }
        let (adapter, handle) = best(name, turn)?;
        let wanted = OPTIONAL_FEATURES | wanted_by_kernels(&adapter);
        let (features, limits) = (handle.features() & wanted, handle.limits());
        Self::of(adapter, &handle, features, limits)
    }

    /// Opens the adapter that [`open`](Self::open) chooses, but only with the capabilities of core
    /// WebGPU, as in a browser or on a phone. The limits are those of core WebGPU. SPIR-V
    /// and pipeline caches are the only optional features, so that kernels are compiled in the same
    /// way.
    pub fn open_core(name: Option<&str>) -> Result<Self> {
        let (adapter, handle) = best(name, 0)?;
        let AdapterDescription { name, api, kind, driver, vertex_storage, .. } = adapter;
        let adapter = AdapterDescription { name, api, kind, driver, vertex_storage, ..AdapterDescription::core() };
        let features = handle.features() & of_spirv(&adapter);
        Self::of(adapter, &handle, features, wgpu::Limits::default())
    }

    fn of(
        adapter: AdapterDescription,
        handle: &wgpu::Adapter,
        features: wgpu::Features,
        required_limits: wgpu::Limits,
    ) -> Result<Self> {
        let file = stored::file_of(&adapter, handle);
        let of_file = if file.is_some() { wgpu::Features::PIPELINE_CACHE } else { wgpu::Features::empty() };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("epsplat"),
            required_features: features | of_file,
            required_limits,
            // There are few, large buffers: without pooling, a scene uses only the memory of its
            // buffers.
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        };
        // NVIDIA's driver may also fail if threads create devices concurrently (kvark/blade#336).
        static OPENING: Mutex<()> = Mutex::new(());
        let opening = OPENING.lock();
        let (device, queue) = pollster::block_on(handle.request_device(&descriptor))
            .map_err(|e| Error::Gpu { adapter: adapter.name.clone(), what: format!("cannot open the device: {e}") })?;
        drop(opening);
        let mut compiled = Compiled::default();
        compiled.stored = file.and_then(|file| Stored::open(&device, file));
        Ok(Self { compiled: Arc::new(compiled), ..Self::watching(adapter, device, queue) })
    }

    /// Wraps a device whose errors others handle.
    pub(super) fn unwatched(adapter: AdapterDescription, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self { adapter, device, queue, compiled: Arc::default(), spare: Arc::default(), failure: Arc::default() }
    }

    /// Keeps the first error that the device reports, such as its loss.
    fn watching(adapter: AdapterDescription, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        let gpu = Self::unwatched(adapter, device, queue);
        let Self { device, failure, .. } = &gpu;
        let slot = Arc::clone(failure);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            if let Ok(mut slot) = slot.lock() {
                slot.get_or_insert_with(|| error.to_string());
            }
        }));
        let slot = Arc::clone(failure);
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed
                && let Ok(mut slot) = slot.lock()
            {
                slot.get_or_insert_with(|| format!("the device was lost ({reason:?}): {message}"));
            }
        });
        gpu
    }

    /// Limits the buffers of this device to `bytes` each, so that scenes and images are cut into
    /// more pages and bands than the adapter requires. This bounds memory, and lets tests cross
    /// page borders with small scenes.
    pub fn with_buffer_limit(mut self, bytes: u64) -> Self {
        let limit = &mut self.adapter.max_storage_buffer_binding_size;
        *limit = bytes.min(*limit);
        self
    }

    /// Returns an error that names this device's adapter.
    pub(crate) fn error(&self, what: impl Into<String>) -> Error {
        self.adapter.error(what)
    }

    /// Fails if the device reported an error since the last call.
    pub(crate) fn check(&self) -> Result<()> {
        let report = self.failure.lock().ok().and_then(|mut slot| slot.take());
        match report {
            None => Ok(()),
            Some(text) => {
                // wgpu's reports have many lines; the first and the last, which is the innermost
                // cause, are enough.
                let lines: Vec<_> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
                let (first, last) = (lines.first().unwrap_or(&""), lines.last().unwrap_or(&""));
                Err(self.error(if first == last { (*first).to_owned() } else { format!("{first}: {last}") }))
            }
        }
    }

    /// Creates an encoder of commands.
    pub(crate) fn encoder(&self) -> wgpu::CommandEncoder {
        self.device.create_command_encoder(&Default::default())
    }

    /// Submits the commands of an encoder.
    pub(crate) fn submit(&self, encoder: wgpu::CommandEncoder) {
        Traffic::count(Traffic { submits: 1, ..Traffic::default() });
        self.queue.submit([encoder.finish()]);
    }

    /// Waits until the device has finished all submitted work.
    pub(crate) fn wait(&self) -> Result<()> {
        Traffic::count(Traffic { waits: 1, ..Traffic::default() });
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|e| self.error(format!("waiting for the device failed: {e}")))?;
        self.check()
    }

    /// Returns a buffer that the host maps to read `bytes`.
    pub(crate) fn tray(&self, bytes: u64) -> wgpu::Buffer {
        self.spare.tray(self, bytes)
    }

    /// Takes back a buffer that [`tray`](Self::tray) returned.
    pub(crate) fn keep_tray(&self, tray: wgpu::Buffer) {
        self.spare.keep(tray);
    }

    /// Whether the device takes kernels in SPIR-V, and so rounds every operation separately
    /// (`spirv.rs`).
    pub(super) fn takes_spirv(&self) -> bool {
        self.device.features().contains(wgpu::Features::PASSTHROUGH_SHADERS)
    }

    /// Largest buffer that fits one binding, bytes.
    pub fn buffer_limit(&self) -> u64 {
        self.adapter.buffer_limit()
    }
}
