//! What an adapter is and can, as plain data.

use serde::Serialize;

use super::layout::{TILE, TILE_WIDTH, WORKGROUP};
use crate::error::Error;

/// Invocations of the largest workgroup, that of `bin.wgsl`.
const LARGEST_WORKGROUP: u32 = 256;

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
    /// Bytes a uniform may have.
    pub max_uniform_buffer_binding_size: u64,
    /// Pixels along a side of a texture.
    pub max_texture_dimension_2d: u32,
    /// Bytes a pixel of all blended targets together may have.
    pub max_color_attachment_bytes_per_sample: u32,
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
    pub(super) fn of(adapter: &wgpu::Adapter) -> Self {
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
            usable: able.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
                && limits.max_storage_buffers_per_shader_stage >= STORAGE_BUFFERS
                && limits.max_compute_invocations_per_workgroup >= LARGEST_WORKGROUP.max(WORKGROUP.max(TILE * TILE))
                && limits.max_compute_workgroup_size_x >= LARGEST_WORKGROUP.max(TILE)
                && limits.max_compute_workgroup_size_y >= TILE,
        }
    }

    /// An adapter that grants what every WebGPU implementation does, and nothing else.
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

    /// Bytes that one buffer and one binding of it may have.
    pub fn buffer_limit(&self) -> u64 {
        self.max_storage_buffer_binding_size.min(self.max_buffer_size)
    }

    /// Elements of `stride` bytes that fit a page, for the largest of the strides that are paged together.
    pub fn page_len(&self, stride: usize) -> u64 {
        let invocations = u64::from(self.max_compute_workgroups_per_dimension).pow(2) * u64::from(WORKGROUP);
        (self.buffer_limit() / stride as u64).min(invocations).min(u64::from(u32::MAX))
    }

    /// The processor draws, and not a card.
    pub fn is_software(&self) -> bool {
        self.kind == "software"
    }

    /// An error of this adapter.
    pub fn error(&self, what: impl Into<String>) -> Error {
        Error::Gpu { adapter: self.name.clone(), what: what.into() }
    }

    /// The order in which `auto` prefers adapters, best first: hardware, then software, then whatever GL reaches.
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

    /// Whether `--adapter name` means this one: an API's name is all adapters of that API and no others, so that `gl` is not
    /// found in the middle of a word; any other name is a part of the adapter's own.
    pub(super) fn is_meant_by(&self, name: &str) -> bool {
        let name = name.to_lowercase();
        match name.as_str() {
            "vulkan" | "gl" | "metal" | "dx12" => self.api == name,
            "opengl" => self.api == "gl",
            _ => self.name.to_lowercase().contains(&name),
        }
    }
}

/// The most storage buffers a kernel uses, which is as many as core WebGPU grants (large splats' fragments: the queue, splats, surfels,
/// their attributes, how many fragments have no place, where lists start, keys and records).
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
