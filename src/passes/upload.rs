//! Stage 0: the scene in device memory, in an [`order`] that draws well, in pages that fit a binding.

use std::borrow::Cow;
use std::ops::Range;

use bytemuck::Pod;
use rayon::prelude::*;

use super::cull::ball;
use super::order::order;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::{Buffer, page_len};
use crate::gpu::kernel::Bound;
use crate::gpu::layout::{BATCH, MOST_GROUPS, Splat};
use crate::plan::{ColorNeed, SceneNeeds};
use crate::progress::Progress;
use crate::scene::color::SRGB8_TO_LINEAR;
use crate::scene::{Bounds, Colors, Scene, Surfel, copies};

/// Surfels and, if they differ in it, their colour.
pub struct SurfelBuffer {
    /// Consecutive pages; every kernel sees one at a time.
    pub pages: Vec<SurfelPage>,
    /// The table that decodes 8-bit sRGB.
    pub(crate) srgb_to_linear: Option<Buffer<[[f32; 4]; 64]>>,
    /// The texture's.
    pub(crate) texels: Option<Buffer<[u8; 4]>>,
}

/// One page of a [`SurfelBuffer`].
pub struct SurfelPage {
    /// The disks.
    pub surfels: Buffer<Surfel>,
    /// What their centres leave out, if it matters.
    pub(crate) low: Option<Buffer<[f32; 3]>>,
    /// How many each stands for, if any for more than itself.
    pub(crate) copies: Option<Buffer<u32>>,
    /// Surfels that they stand for together.
    pub count: u64,
    /// The bounding balls of their batches.
    pub(crate) balls: Buffer<[f32; 4]>,
    pub(crate) colors: Option<wgpu::Buffer>,
}

impl SurfelBuffer {
    /// Uploads `scene` as far as `needs` asks for it, in the [`order`] that draws well where its `core` is given, or as it is.
    pub fn upload(
        gpu: &Gpu,
        scene: &Scene,
        needs: &SceneNeeds,
        core: Option<&Bounds>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        // The splat's record is the largest of what is paged alike.
        // Whole batches, unless one is too large; each is a row of a dispatch, of which every adapter grants so many.
        let most = page_len(gpu, size_of::<Splat>());
        let whole = most / u64::from(BATCH) * u64::from(BATCH);
        let len = if whole > 0 { whole.min(u64::from(MOST_GROUPS * BATCH)) } else { most } as usize;
        progress.begin("uploading surfels", scene.surfels.len() as u64);
        let mut pages = Vec::new();
        let given = || (0..scene.surfels.len() as u32).collect();
        let mut order = core.map_or_else(given, |core| order(&scene.surfels, core));
        let copies = needs.copies.then(|| copies(scene));
        if let Some(copies) = &copies {
            order.retain(|&index| copies[index as usize] > 0);
        }
        for indices in order.chunks(len) {
            let surfels = Buffer::storage(gpu, "surfels", indices.len() as u64)?;
            surfels.write(gpu, indices.len(), |range| taken(&scene.surfels, &indices[range]), progress)?;
            let low = match needs.doubled {
                true => {
                    let low = Buffer::storage(gpu, "trailing parts of centres", indices.len() as u64)?;
                    low.write(gpu, indices.len(), |range| taken(&scene.low, &indices[range]), &())?;
                    Some(low)
                }
                false => None,
            };
            let stand_for = copies.as_ref().map(|copies| stand_for(gpu, copies, indices)).transpose()?;
            let count = copies.as_ref().map_or(indices.len() as u64, |copies| {
                indices.iter().map(|&index| u64::from(copies[index as usize])).sum()
            });
            let colors = match (needs.color, &scene.colors) {
                (ColorNeed::Srgb8, Colors::Srgb8(codes)) => Some(upload(gpu, codes, indices)?),
                (ColorNeed::Linear, Colors::Linear(colors)) => Some(upload(gpu, colors, indices)?),
                (ColorNeed::Textured, Colors::Textured(textured)) => {
                    let buffer = Buffer::storage(gpu, "colours", indices.len() as u64)?;
                    let all = |&index: &u32| {
                        let [center, u_slope, v_slope] = textured.mapped(index as usize, scene.low.get(index as usize));
                        [textured.colors()[index as usize], center, u_slope, v_slope]
                    };
                    let values = |range: Range<usize>| indices[range].par_iter().map(all).collect::<Vec<_>>().into();
                    buffer.write(gpu, indices.len(), values, &())?;
                    Some(buffer.raw)
                }
                _ => None,
            };
            let batches: Vec<_> = indices
                .par_chunks(BATCH as usize)
                .map(|batch| ball(batch.iter().map(|&i| (scene.center(i as usize), &scene.surfels[i as usize]))))
                .collect();
            let balls = Buffer::storage(gpu, "batches", batches.len() as u64)?;
            balls.write(gpu, batches.len(), |range| batches[range].into(), &())?;
            pages.push(SurfelPage { surfels, low, copies: stand_for, count, balls, colors });
        }
        let srgb_to_linear = match needs.color {
            ColorNeed::Srgb8 | ColorNeed::Textured => {
                let table = std::array::from_fn(|row| std::array::from_fn(|k| SRGB8_TO_LINEAR[4 * row + k]));
                Some(Buffer::uniform(gpu, "sRGB table", &table)?)
            }
            _ => None,
        };
        let texels = match &scene.colors {
            Colors::Textured(textured) => {
                let texels = textured.texture().texels();
                let buffer = Buffer::storage(gpu, "the texture", texels.len() as u64)?;
                buffer.write(gpu, texels.len(), |range| texels[range].into(), &())?;
                Some(buffer)
            }
            _ => None,
        };
        progress.end();
        Ok(Self { pages, srgb_to_linear, texels })
    }

    /// What looks up the texture.
    pub(crate) fn texture(&self) -> Bound<'_> {
        let table = self.srgb_to_linear.as_ref().map(|table| ("srgb_to_linear", table.bound()));
        table.into_iter().chain(self.texels.as_ref().map(|texels| ("texels", texels.bound()))).collect()
    }

    /// Device memory that it takes, bytes.
    pub fn bytes(&self) -> u64 {
        let of_page = |page: &SurfelPage| {
            let low = page.low.as_ref().map_or(0, Buffer::bytes) + page.copies.as_ref().map_or(0, Buffer::bytes);
            page.surfels.bytes() + low + page.balls.bytes() + page.colors.as_ref().map_or(0, wgpu::Buffer::size)
        };
        let of_colors =
            self.srgb_to_linear.as_ref().map_or(0, Buffer::bytes) + self.texels.as_ref().map_or(0, Buffer::bytes);
        self.pages.iter().map(of_page).sum::<u64>() + of_colors
    }
}

fn stand_for(gpu: &Gpu, copies: &[u32], indices: &[u32]) -> Result<Buffer<u32>> {
    let buffer = Buffer::storage(gpu, "numbers of copies", indices.len() as u64)?;
    buffer.write(gpu, indices.len(), |range| taken(copies, &indices[range]), &())?;
    Ok(buffer)
}

fn upload<T: Pod + Send + Sync>(gpu: &Gpu, values: &[T], indices: &[u32]) -> Result<wgpu::Buffer> {
    let buffer = Buffer::storage(gpu, "colours", indices.len() as u64)?;
    buffer.write(gpu, indices.len(), |range| taken(values, &indices[range]), &())?;
    Ok(buffer.raw)
}

/// The values at `indices`.
fn taken<'a, T: Pod + Send + Sync>(values: &[T], indices: &[u32]) -> Cow<'a, [T]> {
    indices.par_iter().map(|&index| values[index as usize]).collect::<Vec<_>>().into()
}
