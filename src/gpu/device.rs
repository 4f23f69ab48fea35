//! Adapters and the device: the sole owner of wgpu's instance, limits and errors.

use std::sync::{Arc, Mutex, OnceLock};

use super::adapter::AdapterDescription;
use super::program::Compiled;
use crate::error::{Error, Result};

/// Features that are used where an adapter has them: GPU times, atomics of some accumulators, and a format of blending.
const OPTIONAL_FEATURES: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY
    .union(wgpu::Features::SHADER_INT64)
    .union(wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS)
    .union(wgpu::Features::SHADER_FLOAT32_ATOMIC)
    .union(wgpu::Features::SUBGROUP)
    .union(wgpu::Features::FLOAT32_BLENDABLE);

/// Kernels can be handed over in SPIR-V (`spirv.rs`); Vulkan alone takes it.
fn of_spirv(adapter: &AdapterDescription) -> wgpu::Features {
    if adapter.api == "vulkan" { wgpu::Features::PASSTHROUGH_SHADERS } else { wgpu::Features::empty() }
}

/// Of an adapter whose memory is the host's the host reads and writes buffers where they lie; a card's would then have them in slow memory.
const SOFTWARE_FEATURES: wgpu::Features = wgpu::Features::MAPPABLE_PRIMARY_BUFFERS;

/// What to do about a missing adapter.
pub const INSTALL_HINT: &str = "install a Vulkan driver (on Debian or Ubuntu without a GPU: \
    apt-get install mesa-vulkan-drivers libvulkan1) or render with --backend reference";

/// Whether wgpu checks the counts of workgroups that a device tells itself: by a dispatch before each such one, which takes a fifth of the time of
/// small cuts of levels of detail (1.9 ms and not 1.5). Here none is too large: all are grids of `rows_of` (`wgsl/project.wgsl`) for lists that are shorter than 2^30, thus have
/// 65,535 groups a row and 2^14 rows at most, or have a row for each batch of a page, of which there are no more than
/// [`MOST_GROUPS`](super::layout::MOST_GROUPS). Direct3D 12 tells kernels these counts only where they are checked.
fn counts_are_checked() -> bool {
    cfg!(windows) || std::env::var_os("WGPU_VALIDATION_INDIRECT_CALL").is_some_and(|value| value != "0")
}

/// The adapters that OpenGL reaches, or those of all other interfaces.
fn enumerate(of_gl: bool) -> Vec<(AdapterDescription, wgpu::Adapter)> {
    // One instance for the whole run: NVIDIA's driver crashes where threads make and drop instances beside each other (gfx-rs/wgpu#5930).
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

/// All adapters, in the order in which `auto` prefers them. The environment variable `WGPU_BACKEND` (vulkan, gl, ...)
/// narrows them down.
pub fn adapters() -> Vec<AdapterDescription> {
    let mut all: Vec<_> = [false, true].into_iter().flat_map(enumerate).map(|(description, _)| description).collect();
    all.sort_by_key(AdapterDescription::rank);
    all
}

/// The best adapter of this name; see [`Gpu::open`].
fn best(name: Option<&str>) -> Result<(AdapterDescription, wgpu::Adapter)> {
    let wanted = |d: &AdapterDescription| d.usable && name.is_none_or(|name| d.is_meant_by(name));
    // GL is asked last and only if it must be: its libraries complain on stderr where there is no display.
    let mut all = enumerate(false);
    if !all.iter().any(|(d, _)| wanted(d)) {
        all.extend(enumerate(true));
    }
    let known = all.iter().map(|(d, _)| format!("{} ({})", d.name, d.api)).collect::<Vec<_>>().join(", ");
    all.into_iter().find(|(d, _)| wanted(d)).ok_or_else(|| {
        Error::NoAdapter(match (name, known.is_empty()) {
            (_, true) => format!("no graphics adapter was found: {INSTALL_HINT}"),
            (Some(name), false) => {
                format!("no usable adapter has the API or the name {name:?}; there are: {known}")
            }
            (None, false) => format!("no adapter can run compute kernels ({known}): {INSTALL_HINT}"),
        })
    })
}

/// An open device. A clone is the same one: what was compiled for either serves both, and of what the device reports, or if it is lost, whoever asks first is told.
#[derive(Clone)]
pub struct Gpu {
    /// The adapter behind it.
    pub adapter: AdapterDescription,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) compiled: Arc<Compiled>,
    failure: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens the best adapter; or the best of the API that is called `name` (vulkan, gl or opengl, metal, dx12); or, if none
    /// is, the best whose own name contains `name`. Case does not matter.
    pub fn open(name: Option<&str>) -> Result<Self> {
        let (adapter, handle) = best(name)?;
        let software = if adapter.is_software() { SOFTWARE_FEATURES } else { wgpu::Features::empty() };
        let wanted = OPTIONAL_FEATURES | software | of_spirv(&adapter);
        let (features, limits) = (handle.features() & wanted, handle.limits());
        Self::of(adapter, &handle, features, limits)
    }

    /// The adapter that [`open`](Self::open) chooses, as a device that can do what every WebGPU implementation can, a browser's or a
    /// phone's too, and no more: core limits, and no optional feature but that of SPIR-V, so that kernels come to it on the same way.
    pub fn open_core(name: Option<&str>) -> Result<Self> {
        let (adapter, handle) = best(name)?;
        let AdapterDescription { name, api, kind, driver, vertex_storage, .. } = adapter;
        let adapter = AdapterDescription { name, api, kind, driver, vertex_storage, ..AdapterDescription::core() };
        let features = handle.features() & of_spirv(&adapter);
        Self::of(adapter, &handle, features, wgpu::Limits::default())
    }

    fn of(
        adapter: AdapterDescription,
        handle: &wgpu::Adapter,
        required_features: wgpu::Features,
        required_limits: wgpu::Limits,
    ) -> Result<Self> {
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("epsplat"),
            required_features,
            required_limits,
            // Few large buffers: no pooling, so that a scene costs what its buffers cost.
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        };
        // NVIDIA's driver is in doubt where threads make devices beside each other, too (kvark/blade#336).
        static OPENING: Mutex<()> = Mutex::new(());
        let opening = OPENING.lock();
        let (device, queue) = pollster::block_on(handle.request_device(&descriptor))
            .map_err(|e| Error::Gpu { adapter: adapter.name.clone(), what: format!("cannot open the device: {e}") })?;
        drop(opening);
        let failure = Arc::new(Mutex::new(None));
        let slot = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            if let Ok(mut slot) = slot.lock() {
                slot.get_or_insert_with(|| error.to_string());
            }
        }));
        let slot = Arc::clone(&failure);
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed
                && let Ok(mut slot) = slot.lock()
            {
                slot.get_or_insert_with(|| format!("the device was lost ({reason:?}): {message}"));
            }
        });
        Ok(Self { adapter, device, queue, compiled: Arc::default(), failure })
    }

    /// This device with smaller buffers, of at most `bytes` each: scenes and images are cut into more pages and bands
    /// than the adapter asks for. It bounds memory, and lets tests cross page borders with small scenes.
    pub fn with_buffer_limit(mut self, bytes: u64) -> Self {
        let limit = &mut self.adapter.max_storage_buffer_binding_size;
        *limit = bytes.min(*limit);
        self
    }

    /// An error of this device.
    pub(crate) fn error(&self, what: impl Into<String>) -> Error {
        self.adapter.error(what)
    }

    /// Fails if the device reported an error since the last call.
    pub(crate) fn check(&self) -> Result<()> {
        let report = self.failure.lock().ok().and_then(|mut slot| slot.take());
        match report {
            None => Ok(()),
            Some(text) => {
                // wgpu's reports run over many lines; the first and the innermost cause say it.
                let lines: Vec<_> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
                let (first, last) = (lines.first().unwrap_or(&""), lines.last().unwrap_or(&""));
                Err(self.error(if first == last { (*first).to_owned() } else { format!("{first}: {last}") }))
            }
        }
    }

    /// Waits until the device has done all that was submitted.
    pub(crate) fn wait(&self) -> Result<()> {
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|e| self.error(format!("waiting for the device failed: {e}")))?;
        self.check()
    }

    /// Whether kernels are handed to it in SPIR-V: whether its operations are rounded as they stand (`spirv.rs`).
    pub(super) fn takes_spirv(&self) -> bool {
        self.device.features().contains(wgpu::Features::PASSTHROUGH_SHADERS)
    }

    /// Bytes that one buffer and one binding of it may have.
    pub fn buffer_limit(&self) -> u64 {
        self.adapter.buffer_limit()
    }
}
