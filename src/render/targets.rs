//! The rasteriser's textures for the whole image: a depth buffer, blended sums and triangle
//! numbers.

use crate::error::Result;
use crate::gpu::Gpu;
use crate::passes::raster::{DEPTH_FORMAT, SUM_NAMES, texture_format};
use crate::passes::triangles::NUMBERS;
use crate::plan::{Plan, Raster};

/// The render targets of the rasteriser.
pub struct Targets {
    /// The depth buffer.
    pub depth: wgpu::TextureView,
    /// The blended sums, four channels in each texture.
    pub sums: Vec<wgpu::TextureView>,
    /// The number of the nearest triangle per pixel, if there are triangles.
    pub triangles: Option<wgpu::TextureView>,
    /// Device memory of all textures, bytes.
    pub bytes: u64,
}

impl Targets {
    /// Creates the textures for the image of `plan`.
    ///
    /// # Errors
    /// If the device is out of memory or reports an error.
    pub fn new(gpu: &Gpu, raster: Raster, plan: &Plan) -> Result<Self> {
        let height = plan.bands.iter().map(|band| band.rows).sum();
        let mut bytes = 0;
        let guard = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let mut view = |label, format: wgpu::TextureFormat| {
            let pixels = u64::from(plan.width) * u64::from(height);
            bytes += u64::from(format.block_copy_size(None).unwrap_or(4)) * pixels;
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: plan.width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            texture.create_view(&Default::default())
        };
        let depth = view("nearest depths", DEPTH_FORMAT);
        let format = texture_format(raster.format);
        let sums = SUM_NAMES.iter().take(plan.pixel.targets() as usize).map(|name| view(name, format)).collect();
        let triangles = plan.needs.mesh.map(|_| view("nearest triangles", NUMBERS));
        if pollster::block_on(guard.pop()).is_some() {
            return Err(gpu.error("out of memory for the blended sums: choose a smaller image"));
        }
        gpu.check()?;
        Ok(Self { depth, sums, triangles, bytes })
    }

    /// The texture that a WGSL variable of this name is bound to.
    pub fn binding(&self, name: &str) -> Option<wgpu::BindingResource<'_>> {
        let sums = SUM_NAMES.iter().zip(&self.sums).find(|(sums, _)| **sums == name).map(|(_, view)| view);
        let view = match name {
            "nearest_depth" => Some(&self.depth),
            "drawn_triangles" => self.triangles.as_ref(),
            _ => sums,
        }?;
        Some(wgpu::BindingResource::TextureView(view))
    }
}
