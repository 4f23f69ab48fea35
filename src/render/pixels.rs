//! The buffers of a frame's pixels: nearest depths, sums, image; and the bands of rows that they hold at a time.

use super::Renderer;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::layout::{Band, MOST_ROUNDS, OCCLUSION_TILE, TILE, View};
use crate::passes::accumulate::AttributeBuffer;
use crate::passes::resolve::ImageBuffer;
use crate::passes::variant::Variant;
use crate::passes::visibility::VisibilityBuffer;
use crate::passes::{Rows, raster};
use crate::plan::{PixelLayout, Raster};
use crate::scene::Camera;

/// The buffers of a frame's pixels.
pub(super) struct PixelBuffers {
    /// What they were made for.
    pub(super) made_for: PixelKey,
    pub(super) bands: Vec<Rows>,
    pub(super) sums: Sums,
    pub(super) image: ImageBuffer,
    pub(super) view: Buffer<View>,
}

/// An image's width and height, the room that its pixels take, and whether their sums are gathered.
pub(super) type PixelKey = ((u32, u32), PixelLayout, bool);

/// Where the nearest depths and the weighted sums are kept.
pub(super) enum Sums {
    /// In storage buffers, by the compute kernels, a band at a time.
    Storage(VisibilityBuffer, AttributeBuffer),
    /// Nearest depths in storage; tiles gather the sums, and do not store them.
    Gathered(VisibilityBuffer),
    /// In textures, by the rasteriser, the whole image at once.
    Targets(Raster, raster::Targets),
}

impl Sums {
    /// The compute kernels' nearest depths.
    pub(super) fn nearest(&self) -> Option<&VisibilityBuffer> {
        match self {
            Self::Storage(nearest, _) | Self::Gathered(nearest) => Some(nearest),
            Self::Targets(..) => None,
        }
    }
}

impl PixelBuffers {
    pub(super) fn key(camera: &Camera, variant: &Variant) -> PixelKey {
        ((camera.width, camera.height), variant.pixel, variant.needs.gather)
    }

    pub(super) fn new(gpu: &Gpu, renderer: &Renderer<'_>, camera: &Camera, variant: &Variant) -> Result<Self> {
        let bands = bands(gpu, camera, variant)?;
        let most = bands.iter().map(|rows| rows.pixels).max().unwrap_or(0);
        let sums = match variant.needs.raster {
            None if variant.needs.gather => Sums::Gathered(VisibilityBuffer::new(gpu, &bands)?),
            None => Sums::Storage(VisibilityBuffer::new(gpu, &bands)?, AttributeBuffer::new(gpu, variant, most)?),
            Some(raster) => Sums::Targets(raster, raster::Targets::new(gpu, raster, variant.pixel, camera, &bands)?),
        };
        Ok(Self {
            made_for: Self::key(camera, variant),
            bands,
            sums,
            image: ImageBuffer::new(gpu, variant, most)?,
            view: Buffer::uniform(gpu, "view", &renderer.view(camera))?,
        })
    }

    pub(super) fn bytes(&self) -> u64 {
        let sums = match &self.sums {
            Sums::Storage(nearest, sums) => nearest.nearest.bytes() + sums.bytes(),
            Sums::Gathered(nearest) => nearest.nearest.bytes(),
            Sums::Targets(_, targets) => targets.bytes,
        };
        let uniforms = self.view.bytes() + self.bands.iter().map(|rows| rows.uniform.bytes()).sum::<u64>();
        sums + self.image.bytes() + uniforms
    }
}

/// Rows of the image whose sums fit a binding.
pub(super) fn rows_per_band(gpu: &Gpu, camera: &Camera, variant: &Variant) -> Result<u32> {
    let row_bytes = u64::from(camera.width) * u64::from(variant.sum_words().max(variant.pixel.image_words)) * 4;
    let rows = gpu.buffer_limit() / row_bytes;
    if rows == 0 {
        return Err(Error::Limit {
            adapter: gpu.adapter.name.clone(),
            limit: "max_storage_buffer_binding_size",
            available: gpu.buffer_limit(),
            needed: row_bytes,
            what: format!("for one row of {} pixels; choose a narrower image", camera.width),
        });
    }
    // A workgroup that draws a splat over the whole band must not tire its invocations.
    let most_pixels = u64::from(MOST_ROUNDS * TILE * TILE);
    Ok(rows.min(most_pixels / u64::from(camera.width)).min(u64::from(camera.height)) as u32)
}

/// The image in bands of whole rows.
pub(crate) fn bands(gpu: &Gpu, camera: &Camera, variant: &Variant) -> Result<Vec<Rows>> {
    let rows_per_band = rows_per_band(gpu, camera, variant)?;
    let mut bands = Vec::new();
    let mut first = 0;
    while first < camera.height {
        let count = rows_per_band.min(camera.height - first);
        let band = Band { first_row: first, rows: count, padding_0: 0, padding_1: 0 };
        let uniform = Buffer::uniform(gpu, "band", &band)?;
        let [tiles_x, tiles_y] = [camera.width, count].map(|side| u64::from(side.div_ceil(OCCLUSION_TILE)));
        let pixels = u64::from(count) * u64::from(camera.width);
        bands.push(Rows { first, count, pixels, tiles: tiles_x * tiles_y, uniform });
        first += count;
    }
    Ok(bands)
}
