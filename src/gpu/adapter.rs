//! Capabilities of a graphics adapter, as plain data.

use serde::Serialize;

use super::layout::{TILE, TILE_WIDTH, WORKGROUP};
use super::twin;
use crate::error::Error;

/// Invocations of the largest workgroup, which is in `bin.wgsl`.
const LARGEST_WORKGROUP: u32 = 256;

/// Identity and capabilities of an adapter, as far as the renderer uses them.
#[derive(Clone, Debug, Serialize)]
pub struct AdapterDescription {
    /// Name; `--adapter` matches a part of it.
    pub name: String,
    /// API: vulkan, gl, metal or dx12; `--adapter` matches it too.
    pub api: String,
    /// Kind: discrete, integrated, virtual, software or other.
    pub kind: &'static str,
    /// Driver name and version.
    pub driver: String,
    /// Largest binding of a storage buffer, bytes; scenes and images are paged to fit it.
    pub max_storage_buffer_binding_size: u64,
    /// Largest buffer, bytes.
    pub max_buffer_size: u64,
    /// Most workgroups in each dimension of a dispatch.
    pub max_compute_workgroups_per_dimension: u32,
    /// Most bytes of memory that the invocations of a workgroup can share.
    pub max_compute_workgroup_storage_size: u32,
    /// Most storage buffers that one kernel can bind.
    pub max_storage_buffers_per_shader_stage: u32,
    /// Largest uniform, bytes.
    pub max_uniform_buffer_binding_size: u64,
    /// Longest side of a texture, pixels.
    pub max_texture_dimension_2d: u32,
    /// Most bytes per pixel of all blended targets together.
    pub max_color_attachment_bytes_per_sample: u32,
    /// Whether GPU times can be measured per pass.
    pub timestamps: bool,
    /// Whether storage buffers have u64 atomic min, max and add.
    pub atomics_u64: bool,
    /// Whether kernels have 64-bit integers.
    pub integers_u64: bool,
    /// Whether storage buffers have f32 atomic add.
    pub atomics_f32: bool,
    /// Whether it blends into targets of 32-bit floats.
    pub blends_f32: bool,
    /// Whether it has subgroup operations, with at least [`TILE_WIDTH`] invocations per subgroup.
    pub subgroups: bool,
    /// Whether vertex shaders can read storage buffers, as those of the rasteriser do.
    pub vertex_storage: bool,
    /// Whether it meets the minimum for rendering: compute shaders, [`STORAGE_BUFFERS`], and the
    /// workgroup sizes of the kernels.
    pub usable: bool,
}

impl AdapterDescription {
    pub(super) fn of(adapter: &wgpu::Adapter) -> Self {
        Self::with(adapter, adapter.features(), &adapter.limits())
    }

    /// Describes a device of `adapter` that has `features` and `limits`.
    pub(super) fn with(adapter: &wgpu::Adapter, features: wgpu::Features, limits: &wgpu::Limits) -> Self {
        let info = adapter.get_info();
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
            max_compute_workgroup_storage_size: limits.max_compute_workgroup_storage_size,
            max_storage_buffers_per_shader_stage: limits.max_storage_buffers_per_shader_stage,
            max_uniform_buffer_binding_size: limits.max_uniform_buffer_binding_size,
            max_texture_dimension_2d: limits.max_texture_dimension_2d,
            max_color_attachment_bytes_per_sample: limits.max_color_attachment_bytes_per_sample,
            timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
            atomics_u64: features.contains(wgpu::Features::SHADER_INT64 | wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS),
            integers_u64: features.contains(wgpu::Features::SHADER_INT64),
            atomics_f32: features.contains(wgpu::Features::SHADER_FLOAT32_ATOMIC),
            blends_f32: features.contains(wgpu::Features::FLOAT32_BLENDABLE),
            subgroups: features.contains(wgpu::Features::SUBGROUP) && info.subgroup_min_size >= TILE_WIDTH,
            vertex_storage: able.contains(wgpu::DownlevelFlags::VERTEX_STORAGE),
            usable: lacking(able, limits).is_none(),
        }
    }

    /// An adapter with the limits of core WebGPU and no optional feature.
    pub fn core() -> Self {
        let limits = wgpu::Limits::default();
        Self {
            name: "core WebGPU".into(),
            api: String::new(),
            kind: "other",
            driver: String::new(),
            max_storage_buffer_binding_size: limits.max_storage_buffer_binding_size,
            max_buffer_size: limits.max_buffer_size,
            max_compute_workgroups_per_dimension: limits.max_compute_workgroups_per_dimension,
            max_compute_workgroup_storage_size: limits.max_compute_workgroup_storage_size,
            max_storage_buffers_per_shader_stage: limits.max_storage_buffers_per_shader_stage,
            max_uniform_buffer_binding_size: limits.max_uniform_buffer_binding_size,
            max_texture_dimension_2d: limits.max_texture_dimension_2d,
            max_color_attachment_bytes_per_sample: limits.max_color_attachment_bytes_per_sample,
            timestamps: false,
            atomics_u64: false,
            integers_u64: false,
            atomics_f32: false,
            blends_f32: false,
            subgroups: false,
            vertex_storage: true,
            usable: true,
        }
    }

    /// Largest buffer that fits one binding, bytes.
    pub fn buffer_limit(&self) -> u64 {
        self.max_storage_buffer_binding_size.min(self.max_buffer_size)
    }

    /// Returns how many elements of `stride` bytes fit a page. If several buffers are paged
    /// together, `stride` must be the largest size of their elements.
    pub fn page_len(&self, stride: usize) -> u64 {
        let invocations = u64::from(self.max_compute_workgroups_per_dimension).pow(2) * u64::from(WORKGROUP);
        (self.buffer_limit() / stride as u64).min(invocations).min(u64::from(u32::MAX))
    }

    /// Whether it renders on the CPU.
    pub fn is_software(&self) -> bool {
        self.kind == "software"
    }

    /// Whether its quotients and roots are rounded to nearest: processors' instructions are, if a
    /// driver uses them (Mesa's llvmpipe and SwiftShader do, and so does the f32 twin).
    pub fn rounds_division(&self) -> bool {
        self.is_software() && matches!(self.api.as_str(), "vulkan" | "gl" | twin::API)
    }

    /// Whether its conversions from u32 to f32 round to nearest. SwiftShader rounds numbers above
    /// 2^31 twice.
    pub fn rounds_integers(&self) -> bool {
        self.rounds_division() && !self.name.contains("SwiftShader")
    }

    /// Returns an error that names this adapter.
    pub fn error(&self, what: impl Into<String>) -> Error {
        Error::Gpu { adapter: self.name.clone(), what: what.into() }
    }

    /// Rank by which `auto` prefers adapters, 0 first: hardware, then software, then GL, and last
    /// those that are not usable.
    pub(super) fn rank(&self) -> u32 {
        let kind = match self.kind {
            "discrete" => 0,
            "integrated" => 1,
            "virtual" => 2,
            "software" => 3,
            _ => 4,
        };
        kind + if self.api == "gl" { 10 } else { 0 } + if self.usable { 0 } else { 100 }
    }

    /// Whether `--adapter name` selects this adapter. The name of an API selects all adapters of
    /// that API and no others, so that `gl` does not match the middle of a word. Any other name
    /// selects adapters whose names contain it. Case does not matter.
    pub(super) fn is_meant_by(&self, name: &str) -> bool {
        let name = name.to_lowercase();
        match name.as_str() {
            "vulkan" | "gl" | "metal" | "dx12" => self.api == name,
            "opengl" => self.api == "gl",
            _ => self.name.to_lowercase().contains(&name),
        }
    }
}

/// Returns the first capability that rendering needs and that is missing, as a sentence's end.
pub(super) fn lacking(able: wgpu::DownlevelFlags, limits: &wgpu::Limits) -> Option<String> {
    if !able.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS) {
        return Some("no compute kernels".into());
    }
    let invocations = LARGEST_WORKGROUP.max(WORKGROUP.max(TILE * TILE));
    let all = [
        ("max_storage_buffers_per_shader_stage", limits.max_storage_buffers_per_shader_stage, STORAGE_BUFFERS),
        ("max_compute_invocations_per_workgroup", limits.max_compute_invocations_per_workgroup, invocations),
        ("max_compute_workgroup_size_x", limits.max_compute_workgroup_size_x, LARGEST_WORKGROUP.max(TILE)),
        ("max_compute_workgroup_size_y", limits.max_compute_workgroup_size_y, TILE),
    ];
    let short = all.into_iter().find(|(_, has, needed)| has < needed);
    short.map(|(limit, has, needed)| format!("a {limit} of {has}, and {needed} are needed"))
}

/// The most storage buffers that a kernel binds; core WebGPU grants no more. The kernel that lists
/// the fragments of large splats binds all eight: the queue, splats, surfels, attributes, the count
/// of fragments that did not fit, list starts, keys and records.
pub const STORAGE_BUFFERS: u32 = 8;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_api_is_no_part_of_a_name() {
        let adapter = |name: &str, api: &str| AdapterDescription {
            name: name.to_owned(),
            api: api.to_owned(),
            ..AdapterDescription::core()
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
