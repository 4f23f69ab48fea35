//! Adapters and the device: the sole owner of wgpu's instance, limits and errors.

use std::sync::{Arc, Mutex};

use serde::Serialize;

use super::kernel::Programs;
use super::layout::{TILE, TILE_WIDTH, WORKGROUP};
use crate::error::{Error, Result};

/// What an adapter is and what of it matters here.
#[derive(Clone, Debug, Serialize)]
pub struct AdapterDescription {
    /// Its name, as `--adapter` matches it.
    pub name: String,
    /// vulkan, gl, metal, dx12, as `--adapter` matches it too.
    pub api: String,
    /// discrete, integrated, virtual, software or other.
    pub kind: &'static str,
    /// Driver name and version.
    pub driver: String,
    /// Bytes one binding may see: scenes and images are paged to it.
    pub max_storage_buffer_binding_size: u64,
    /// Bytes one buffer may have.
    pub max_buffer_size: u64,
    /// Workgroups per dimension of a dispatch.
    pub max_compute_workgroups_per_dimension: u32,
    /// Storage buffers one kernel may use.
    pub max_storage_buffers_per_shader_stage: u32,
    /// Per-pass GPU times can be measured.
    pub timestamps: bool,
    /// u64 atomic min, max and add in storage buffers.
    pub atomics_u64: bool,
    /// 64-bit integers.
    pub integers_u64: bool,
    /// f32 atomic add in storage buffers.
    pub atomics_f32: bool,
    /// Blending into targets of 32-bit floats.
    pub blends_f32: bool,
    /// Operations of subgroups that have at least [`TILE_WIDTH`] invocations each.
    pub subgroups: bool,
    /// Vertex shaders read storage buffers, as the rasteriser's do.
    pub vertex_storage: bool,
    /// It has all that rendering needs.
    pub usable: bool,
}

impl AdapterDescription {
    fn of(adapter: &wgpu::Adapter) -> Self {
        let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
        let kind = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => "discrete",
            wgpu::DeviceType::IntegratedGpu => "integrated",
            wgpu::DeviceType::VirtualGpu => "virtual",
            wgpu::DeviceType::Cpu => "software",
            wgpu::DeviceType::Other => "other",
        };
        let able = adapter.get_downlevel_capabilities().flags;
        Self {
            name: info.name,
            api: info.backend.to_str().to_owned(),
            kind,
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            max_storage_buffer_binding_size: limits.max_storage_buffer_binding_size,
            max_buffer_size: limits.max_buffer_size,
            max_compute_workgroups_per_dimension: limits.max_compute_workgroups_per_dimension,
            max_storage_buffers_per_shader_stage: limits.max_storage_buffers_per_shader_stage,
            timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
            atomics_u64: features.contains(wgpu::Features::SHADER_INT64 | wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS),
            integers_u64: features.contains(wgpu::Features::SHADER_INT64),
            atomics_f32: features.contains(wgpu::Features::SHADER_FLOAT32_ATOMIC),
            blends_f32: features.contains(wgpu::Features::FLOAT32_BLENDABLE),
            subgroups: features.contains(wgpu::Features::SUBGROUP) && info.subgroup_min_size >= TILE_WIDTH,
            vertex_storage: able.contains(wgpu::DownlevelFlags::VERTEX_STORAGE),
            usable: able.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
                && limits.max_storage_buffers_per_shader_stage >= STORAGE_BUFFERS
                && limits.max_compute_invocations_per_workgroup >= WORKGROUP.max(TILE * TILE)
                && limits.max_compute_workgroup_size_x >= WORKGROUP.max(TILE)
                && limits.max_compute_workgroup_size_y >= TILE,
        }
    }

    /// The order in which `auto` prefers adapters, best first: hardware, then software, then whatever GL reaches.
    fn rank(&self) -> u32 {
        let kind = match self.kind {
            "discrete" => 0,
            "integrated" => 1,
            "virtual" => 2,
            "software" => 3,
            _ => 4,
        };
        kind + if self.api == "gl" { 10 } else { 0 } + if self.usable { 0 } else { 100 }
    }

    /// Whether `--adapter name` means this one: an API's name is all adapters of that API and no others, so that `gl` is not
    /// found in the middle of a word; any other name is a part of the adapter's own.
    fn is_meant_by(&self, name: &str) -> bool {
        let name = name.to_lowercase();
        match name.as_str() {
            "vulkan" | "gl" | "metal" | "dx12" => self.api == name,
            "opengl" => self.api == "gl",
            _ => self.name.to_lowercase().contains(&name),
        }
    }
}

/// The most storage buffers a kernel uses (accumulate: splats, surfels, depths, sums, colours, the queue, filters, and the overflow
/// count of some accumulators or the copies of another).
pub const STORAGE_BUFFERS: u32 = 8;

/// Features that are used where an adapter has them: GPU times, atomics of some accumulators, and a format of blending.
const OPTIONAL_FEATURES: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY
    .union(wgpu::Features::SHADER_INT64)
    .union(wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS)
    .union(wgpu::Features::SHADER_FLOAT32_ATOMIC)
    .union(wgpu::Features::SUBGROUP)
    .union(wgpu::Features::FLOAT32_BLENDABLE);

/// Of an adapter whose memory is the host's the host reads buffers where they lie; a card's would then have them in slow memory.
const SOFTWARE_FEATURES: wgpu::Features = wgpu::Features::MAPPABLE_PRIMARY_BUFFERS;

/// What to do about a missing adapter.
pub const INSTALL_HINT: &str = "install a Vulkan driver (on Debian or Ubuntu without a GPU: \
    apt-get install mesa-vulkan-drivers libvulkan1) or render with --backend reference";

fn enumerate(backends: wgpu::Backends) -> Vec<(AdapterDescription, wgpu::Adapter)> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    descriptor.backends &= backends;
    let instance = wgpu::Instance::new(descriptor);
    let adapters = pollster::block_on(instance.enumerate_adapters(backends));
    let mut described: Vec<_> = adapters.into_iter().map(|a| (AdapterDescription::of(&a), a)).collect();
    described.sort_by_key(|(description, _)| description.rank());
    described
}

/// All adapters, in the order in which `auto` prefers them. The environment variable `WGPU_BACKEND` (vulkan, gl, ...)
/// narrows them down.
pub fn adapters() -> Vec<AdapterDescription> {
    enumerate(wgpu::Backends::all()).into_iter().map(|(description, _)| description).collect()
}

/// An open device.
pub struct Gpu {
    /// The adapter behind it.
    pub adapter: AdapterDescription,
    /// What it can do at most.
    pub limits: wgpu::Limits,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) programs: Programs,
    failure: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens the best adapter; or the best of the API that is called `name` (vulkan, gl or opengl, metal, dx12); or, if none
    /// is, the best whose own name contains `name`. Case does not matter.
    pub fn open(name: Option<&str>) -> Result<Self> {
        let wanted = |d: &AdapterDescription| d.usable && name.is_none_or(|name| d.is_meant_by(name));
        // GL is asked last and only if it must be: its libraries complain on stderr where there is no display.
        let mut all = enumerate(wgpu::Backends::all() - wgpu::Backends::GL);
        if !all.iter().any(|(d, _)| wanted(d)) {
            all.extend(enumerate(wgpu::Backends::GL));
        }
        let known = all.iter().map(|(d, _)| format!("{} ({})", d.name, d.api)).collect::<Vec<_>>().join(", ");
        let Some((adapter, handle)) = all.into_iter().find(|(d, _)| wanted(d)) else {
            return Err(Error::NoAdapter(match (name, known.is_empty()) {
                (_, true) => format!("no graphics adapter was found: {INSTALL_HINT}"),
                (Some(name), false) => {
                    format!("no usable adapter has the API or the name {name:?}; there are: {known}")
                }
                (None, false) => format!("no adapter can run compute kernels ({known}): {INSTALL_HINT}"),
            }));
        };
        let limits = handle.limits();
        let software = if adapter.kind == "software" { SOFTWARE_FEATURES } else { wgpu::Features::empty() };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("epsplat"),
            required_features: handle.features() & (OPTIONAL_FEATURES | software),
            required_limits: limits.clone(),
            // Few large buffers: no pooling, so that a scene costs what its buffers cost.
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(handle.request_device(&descriptor))
            .map_err(|e| Error::Gpu { adapter: adapter.name.clone(), what: format!("cannot open the device: {e}") })?;
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
        Ok(Self { adapter, limits, device, queue, programs: Programs::default(), failure })
    }

    /// The same device with smaller buffers, of at most `bytes` each: scenes and images are cut into more pages and bands
    /// than the adapter asks for. It bounds memory, and lets tests cross page borders with small scenes.
    pub fn with_buffer_limit(mut self, bytes: u64) -> Self {
        let limit = &mut self.limits.max_storage_buffer_binding_size;
        *limit = bytes.min(*limit);
        self
    }

    /// An error of this device.
    pub(crate) fn error(&self, what: impl Into<String>) -> Error {
        Error::Gpu { adapter: self.adapter.name.clone(), what: what.into() }
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

    /// Bytes that one buffer and one binding of it may have.
    pub fn buffer_limit(&self) -> u64 {
        self.limits.max_storage_buffer_binding_size.min(self.limits.max_buffer_size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_api_is_no_part_of_a_name() {
        let adapter = |name: &str, api: &str| AdapterDescription {
            name: name.to_owned(),
            api: api.to_owned(),
            kind: "software",
            driver: String::new(),
            max_storage_buffer_binding_size: 0,
            max_buffer_size: 0,
            max_compute_workgroups_per_dimension: 0,
            max_storage_buffers_per_shader_stage: 0,
            timestamps: false,
            atomics_u64: false,
            integers_u64: false,
            atomics_f32: false,
            blends_f32: false,
            subgroups: false,
            vertex_storage: false,
            usable: true,
        };
        let all =
            [adapter("Google SwiftShader", "vulkan"), adapter("Mesa OpenGL on Vulkan", "gl"), adapter("M4", "metal")];
        let meant = |name: &str| all.each_ref().map(|adapter| adapter.is_meant_by(name));
        for (name, expected) in [
            ("gl", [false, true, false]),
            ("OpenGL", [false, true, false]),
            ("Vulkan", [true, false, false]),
            ("METAL", [false, false, true]),
            ("dx12", [false, false, false]),
            ("swift", [true, false, false]),
            ("ogl", [true, false, false]),
            ("on vulkan", [false, true, false]),
            ("s", [true, true, false]),
        ] {
            assert_eq!(meant(name), expected, "{name}");
        }
    }
}
