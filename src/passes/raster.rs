//! Stages 2 and 3 by the rasteriser (Botsch et al. 2005): what compute is compared with.
//!
//! The splats are those of [`project`](super::project), their footprint and attributes the same kernels'. A quad covers
//! the pixels that a splat may touch. The **visibility pass** keeps the nearest depth in a depth buffer, the **attribute
//! pass** adds each accepted fragment's terms by additive blending, four channels a target, and
//! [`resolve`](super::resolve) reads the targets. [`RasterDepth`] says how fragments are accepted:
//!
//! - **exact**: fragments write their own depth, scaled by a power of two, and the attribute pass compares in the shader.
//!   It accepts the very fragments that compute accepts.
//! - **offset**, **ray**: the quads lie in the disks' planes, the rasteriser interpolates and compares. Depths err by its
//!   interpolation (a fragment within about 2^-20 of epsilon may be decided otherwise), absolute tolerances are applied at
//!   the quads' corners, and a plane that passes the eye within its quad is bent. OpenGL has no such depths: it takes them
//!   from -1 to 1, of which those far from the eye, all near the end that is 0 elsewhere, keep no digits.
//!
//! **Error.** A sum of n terms in a format of unit roundoff r, in the rasteriser's order, errs by at most `n r` of itself
//! if the format is floating (r = 2^-11 or 2^-24), so a mean by `2 n r + 4 u`; in 8 bits each of the n sums errs by half a
//! step of 1/255 of the [`BlendFormat::MOST_WEIGHTS_8`] weights that it can hold: `8 n / (255 w)` for a summed weight w,
//! and what passes 8 weights is lost. Blending rounds in the order of the quads, so the order of the surfels shows.

use super::covered::Covered;
use super::project::SplatBuffer;
use super::{Recorder, Rows};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::kernel::{Bound, Draw};
use crate::plan::{BlendFormat, ColorNeed, PixelLayout, Raster, RasterDepth, SceneNeeds};
use crate::scene::Camera;

/// Vertices of a splat; see raster.wgsl.
pub fn vertices(needs: &SceneNeeds) -> u32 {
    if needs.triangles { 3 } else { 6 }
}

/// Channels of a target.
const CHANNELS: u32 = 4;

/// Targets that a pixel's sums need.
fn targets(pixel: PixelLayout) -> u32 {
    pixel.channels.div_ceil(CHANNELS)
}

/// The file that declares as many targets as `needs` have.
pub fn targets_file(needs: &SceneNeeds) -> &'static str {
    match targets(PixelLayout::of(needs)) {
        1 => "raster_targets_1.wgsl",
        2 => "raster_targets_2.wgsl",
        // Weight, four of colour, a gap, three of the normal, depth and count: twelve channels at most.
        _ => "raster_targets_3.wgsl",
    }
}

/// What terms are multiplied with.
pub fn blend_scale(format: BlendFormat) -> f64 {
    match format {
        BlendFormat::Rgba8Unorm => 1.0 / f64::from(BlendFormat::MOST_WEIGHTS_8),
        BlendFormat::Rgba16Float | BlendFormat::Rgba32Float => 1.0,
    }
}

fn texture_format(format: BlendFormat) -> wgpu::TextureFormat {
    match format {
        BlendFormat::Rgba8Unorm => wgpu::TextureFormat::Rgba8Unorm,
        BlendFormat::Rgba16Float => wgpu::TextureFormat::Rgba16Float,
        BlendFormat::Rgba32Float => wgpu::TextureFormat::Rgba32Float,
    }
}

const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The pipelines of the two passes.
pub(crate) fn draws(raster: Raster, pixel: PixelLayout) -> Vec<Draw> {
    let depth = |compare, write| {
        Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(write),
            depth_compare: Some(compare),
            stencil: Default::default(),
            bias: Default::default(),
        })
    };
    let (near_first, test) = match raster.depth {
        RasterDepth::Exact => (wgpu::CompareFunction::Less, None),
        // Their depths are largest in front.
        RasterDepth::Offset | RasterDepth::Ray => {
            (wgpu::CompareFunction::Greater, depth(wgpu::CompareFunction::GreaterEqual, false))
        }
    };
    let add = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    };
    let target = wgpu::ColorTargetState {
        format: texture_format(raster.format),
        blend: Some(wgpu::BlendState { color: add, alpha: add }),
        write_mask: wgpu::ColorWrites::ALL,
    };
    let draw = |name, (vertex, fragment), targets, depth, moved: bool| Draw {
        name,
        vertex,
        fragment,
        targets,
        depth,
        constant: Some(("MOVED", u32::from(moved).into())),
    };
    vec![
        draw("visibility", ("shape", "raster_visibility"), vec![], depth(near_first, true), true),
        draw(
            "accumulate",
            ("shape_with_attributes", "raster_attributes"),
            vec![target; targets(pixel) as usize],
            test,
            false,
        ),
    ]
}

/// Fails with a sentence if `gpu` cannot blend this way, or `needs` ask for what blending cannot give.
pub fn check(gpu: &Gpu, raster: Raster, needs: &SceneNeeds, camera: &Camera) -> Result<()> {
    let limit = |limit, available: u32, needed: u32, what: &str| match needed > available {
        false => Ok(()),
        true => Err(Error::Limit {
            adapter: gpu.adapter.name.clone(),
            limit,
            available: available.into(),
            needed: needed.into(),
            what: what.into(),
        }),
    };
    if needs.color == ColorNeed::Textured {
        return Err(Error::Usage(
            "the rasteriser blends no texture coordinates: leave the texture out, or render by compute".into(),
        ));
    }
    if !gpu.adapter.vertex_storage {
        return Err(gpu.error("vertex shaders cannot read the splats here: take --backend gpu, or another --adapter"));
    }
    if raster.depth != RasterDepth::Exact && gpu.adapter.api == "gl" {
        return Err(
            gpu.error("OpenGL interpolates depths too coarsely: take --raster-depth exact, or another --adapter")
        );
    }
    if raster.format == BlendFormat::Rgba32Float && !gpu.adapter.blends_f32 {
        return Err(gpu.error("this adapter does not blend into 32-bit floats: take --blend-format rgba16float"));
    }
    if raster.format == BlendFormat::Rgba8Unorm && needs.count {
        return Err(Error::Usage(
            "an 8-bit target cannot count fragments: leave count out, or take rgba16float".into(),
        ));
    }
    let side = gpu.limits.max_texture_dimension_2d;
    limit("max_texture_dimension_2d", side, camera.width.max(camera.height), "for the image; choose a smaller one")?;
    let bytes = match raster.format {
        BlendFormat::Rgba8Unorm => 8,
        BlendFormat::Rgba16Float => 8,
        BlendFormat::Rgba32Float => 16,
    };
    let needed = bytes * targets(PixelLayout::of(needs));
    let name = "max_color_attachment_bytes_per_sample";
    limit(name, gpu.limits.max_color_attachment_bytes_per_sample, needed, "for the sums; ask for fewer maps")
}

/// The rasteriser's depth buffer and blended sums, of the whole image.
pub struct Targets {
    depth: wgpu::TextureView,
    sums: Vec<wgpu::TextureView>,
    /// The list of covered tiles.
    pub covered: Buffer<u32>,
    /// Device memory, bytes.
    pub bytes: u64,
}

const SUM_NAMES: [&str; 3] = ["sums_0", "sums_1", "sums_2"];

impl Targets {
    /// For an image by `camera`.
    pub fn new(gpu: &Gpu, raster: Raster, pixel: PixelLayout, camera: &Camera, bands: &[Rows]) -> Result<Self> {
        let covered = Buffer::indirect(gpu, "covered tiles", bands.iter().map(Covered::room).max().unwrap_or(0))?;
        let mut bytes = covered.bytes();
        let guard = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let mut view = |label, format: wgpu::TextureFormat| {
            bytes += u64::from(format.block_copy_size(None).unwrap_or(4)) * camera.pixels() as u64;
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: camera.width, height: camera.height, depth_or_array_layers: 1 },
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
        let sums = SUM_NAMES.iter().take(targets(pixel) as usize).map(|name| view(name, format)).collect();
        if pollster::block_on(guard.pop()).is_some() {
            return Err(gpu.error("out of memory for the blended sums: choose a smaller image"));
        }
        gpu.check()?;
        Ok(Self { depth, sums, covered, bytes })
    }

    /// What resolve reads.
    pub(crate) fn bindings(&self) -> Bound<'_> {
        let sums = SUM_NAMES.iter().zip(&self.sums);
        let mut bound: Bound<'_> = sums.map(|(name, view)| (*name, wgpu::BindingResource::TextureView(view))).collect();
        bound.push(("nearest_depth", wgpu::BindingResource::TextureView(&self.depth)));
        bound
    }
}

/// Records both passes over the whole image.
pub fn record(
    recorder: &mut Recorder<'_>,
    raster: Raster,
    splats: &SplatBuffer,
    rows: &Rows,
    targets: &Targets,
) -> Result<()> {
    let (gpu, program) = (recorder.gpu, recorder.program);
    // Where nothing is: the farthest there can be.
    let nothing = if raster.depth == RasterDepth::Exact { 1.0 } else { 0.0 };
    let attachment =
        |load| wgpu::RenderPassDepthStencilAttachment { view: &targets.depth, depth_ops: load, stencil_ops: None };
    let view = [("view", recorder.view.bound()), ("band", rows.uniform.bound())];
    let nearest = ("nearest_depth", wgpu::BindingResource::TextureView(&targets.depth));
    let draw = |pass: &mut wgpu::RenderPass<'_>, name, own: &[(&str, wgpu::BindingResource<'_>)]| {
        for (index, page) in splats.pages.iter().enumerate() {
            // Of more splats a binding would have 45 GB.
            let vertices = u32::try_from(page.splats.len * u64::from(vertices(&recorder.variant.needs)))
                .map_err(|_| gpu.error("a page has too many splats for the rasteriser's vertices"))?;
            program.draw(gpu, pass, name, &splats.bindings(index, own), vertices)?;
        }
        Ok(())
    };
    let clear = wgpu::Operations { load: wgpu::LoadOp::Clear(nothing), store: wgpu::StoreOp::Store };
    recorder
        .timing
        .draw(gpu, "visibility", &[], Some(attachment(Some(clear))), |pass| draw(pass, "visibility", &view))?;
    let sums: Vec<_> = targets
        .sums
        .iter()
        .map(|view| {
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })
        })
        .collect();
    // Without operations the depth buffer is read only, and the shader may not see it either way.
    let (depth, own) = match raster.depth {
        RasterDepth::Exact => (None, [view[0].clone(), view[1].clone(), nearest].to_vec()),
        RasterDepth::Offset | RasterDepth::Ray => (Some(attachment(None)), view.to_vec()),
    };
    recorder.timing.draw(gpu, "accumulate", &sums, depth, |pass| draw(pass, "accumulate", &own))
}
