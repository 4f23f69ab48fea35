//! Copies images to textures of a user's program.

use std::sync::Arc;

use super::frame_layout::FrameLayout;
use super::record::{Recording, staged};
use super::run::Run;
use crate::error::{Error, Result};
use crate::gpu::buffers::Buffer;
use crate::gpu::kernel::{Grid, grid};
use crate::gpu::program::Program;
use crate::gpu::{Gpu, Sources};
use crate::plan::Plan;
use crate::scene::Map;
use crate::scene::color::CODE_THRESHOLDS;

/// The texel formats that an image can be copied to: the number of the kind in
/// `wgsl/device/texture_rows.wgsl`, and the words of a texel. Bytes of colours are sRGB codes, as
/// in a PNG.
fn texel(format: wgpu::TextureFormat) -> Option<(u32, u32)> {
    use wgpu::TextureFormat as Format;
    Some(match format {
        Format::Rgba8Unorm | Format::Rgba8UnormSrgb => (0, 1),
        Format::Bgra8Unorm | Format::Bgra8UnormSrgb => (1, 1),
        Format::Rgba16Float => (2, 2),
        Format::Rgba32Float => (3, 4),
        Format::R32Float => (4, 1),
        _ => return None,
    })
}

/// Checks that `texture` takes the colour of a frame, or its depth.
pub(super) fn check(layout: &FrameLayout, texture: &wgpu::Texture, is_depth: bool) -> Result<()> {
    use wgpu::TextureFormat as Format;
    let format = texture.format();
    let suits =
        if is_depth { format == Format::R32Float } else { texel(format).is_some() && format != Format::R32Float };
    let (width, height) = (texture.width(), texture.height());
    let flat = texture.dimension() == wgpu::TextureDimension::D2 && texture.depth_or_array_layers() == 1;
    let fault = if is_depth && !layout.maps.contains_key(&Map::Depth) {
        "gets no depth, as the renderer's maps lack it".to_owned()
    } else if !suits {
        let all =
            if is_depth { "r32float" } else { "rgba8unorm, bgra8unorm (and their srgb), rgba16float or rgba32float" };
        format!("has the format {format:?}, and not {all}")
    } else if !texture.usage().contains(wgpu::TextureUsages::COPY_DST) {
        "lacks the usage COPY_DST".to_owned()
    } else if (width, height) != (layout.width, layout.height) || !flat || texture.sample_count() != 1 {
        format!("is {width}x{height}, but the frame is one flat image of {}x{}", layout.width, layout.height)
    } else {
        return Ok(());
    };
    let what = if is_depth { "depth" } else { "colour" };
    Err(Error::Usage(format!("the texture for the {what} {fault}: give another one")))
}

/// A texture that takes the colour or the depth of a part of a frame.
#[derive(Clone, Copy)]
pub(super) struct Textured<'a> {
    pub texture: &'a wgpu::Texture,
    /// The first word of the value in a pixel's record.
    pub first: u32,
    /// Whether the values of the colour are sRGB codes from 0 to 1.
    pub codes: bool,
}

/// The buffer of rows from which textures are copied, and the kernel that fills it.
pub(super) struct Rows {
    rows: Buffer<u32>,
    program: Arc<Program>,
}

impl Textured<'_> {
    /// Kind and words of a texel; [`check`] has refused other formats.
    fn texel(&self) -> (u32, u32) {
        texel(self.texture.format()).unwrap_or_default()
    }

    /// Words of a row of texels: rows of a copy start at multiples of 256 bytes.
    fn row(&self) -> u32 {
        (self.texture.width() * self.texel().1).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT / 4)
    }

    /// Rows of the image that a band of `plan` has.
    fn rows_in(&self, plan: &Plan, band: usize) -> u32 {
        plan.bands[band].rows / plan.needs.samples.down
    }
}

impl Rows {
    /// Makes `kept` hold the rows of any band of `plan` for `textures`.
    pub fn fit(
        kept: &mut Option<Self>,
        (gpu, sources): (&Gpu, &Sources),
        plan: &Plan,
        textures: &[Textured<'_>],
    ) -> Result<()> {
        let words = |band| textures.iter().map(move |into| u64::from(into.row()) * u64::from(into.rows_in(plan, band)));
        let most = (0..plan.bands.len()).flat_map(words).max().unwrap_or(0);
        if most > 0 && kept.as_ref().is_none_or(|kept| kept.rows.len < most) {
            let file = (sources, "texture_rows.wgsl");
            let program = gpu.compiled.without_arithmetic(gpu, file, "write_texture_rows")?;
            *kept = Some(Self { rows: Buffer::storage(gpu, "rows of a texture", most)?, program });
        }
        Ok(())
    }
}

impl Run<'_> {
    /// Records the copies of a band's image to the textures.
    pub(super) fn record_textures(&mut self, band: usize) -> Result<()> {
        let Some(Recording { textures, rows: Some(rows), .. }) = &self.recording else { return Ok(()) };
        let (from, _) = self.store.image().ok_or_else(|| self.gpu.error("a frame has no image"))?;
        for into in *textures {
            let ((kind, _), row, height) = (into.texel(), into.row(), into.rows_in(self.plan, band));
            let (width, pixels) = (into.texture.width(), self.plan.image_pixels(band));
            let (stride, codes) = (self.plan.pixel.image_words, &*CODE_THRESHOLDS);
            let tables = if into.codes { [264, 264] } else { [8, 264] };
            let shape = [width, pixels as u32, stride, into.first, row, kind, tables[0], tables[1]];
            let pieces: [&[u8]; 2] = [bytemuck::cast_slice(&shape), bytemuck::cast_slice(codes.as_flattened())];
            let shape = staged(self.gpu, wgpu::BufferUsages::STORAGE, &pieces)?;
            let binding = |name: &str| match name {
                "frame_words" => Some(from.bound()),
                "texture_rows" => Some(rows.rows.bound()),
                "texture_shape" => Some(shape.as_entire_binding()),
                _ => None,
            };
            let over = Grid::Of(grid(self.gpu, pixels)?);
            let write = |pass: &mut wgpu::ComputePass<'_>| {
                rows.program.dispatch(self.gpu, pass, "write_texture_rows", &binding, over)
            };
            self.timing.pass(self.gpu, "texture", |_| {}, write)?;
            let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * row), rows_per_image: None };
            let first = self.plan.bands[band].first / self.plan.needs.samples.down;
            let origin = wgpu::Origin3d { x: 0, y: first, z: 0 };
            let texture = wgpu::TexelCopyTextureInfo { origin, ..into.texture.as_image_copy() };
            let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
            let buffer = wgpu::TexelCopyBufferInfo { buffer: &rows.rows.raw, layout };
            self.timing.encoder(self.gpu).copy_buffer_to_texture(buffer, texture, size);
        }
        Ok(())
    }
}
