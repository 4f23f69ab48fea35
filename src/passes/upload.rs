//! Stage 0: the scene in device memory, in an [`order`] that draws well, in pages that fit a binding.

use std::borrow::Cow;
use std::ops::Range;

use bytemuck::Pod;
use rayon::prelude::*;

use super::cull::ball;
use super::order::order;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::layout::BATCH;
use crate::plan::{ColorNeed, SceneNeeds, page_surfels};
use crate::progress::Progress;
use crate::scene::color::SRGB8_TO_LINEAR;
use crate::scene::{Bounds, Colors, Scene, copies};

/// Buffers by their names in WGSL.
pub type Named = Vec<(&'static str, Buffer<u32>)>;

/// The scene on a device.
pub struct Uploaded {
    /// Consecutive surfels; kernels see one page at a time.
    pub pages: Vec<Page>,
    /// What is there once: the table that decodes 8-bit sRGB, the texture.
    pub shared: Named,
    /// The surfels of all pages, as indices in the scene.
    pub order: Vec<u32>,
}

/// One page of a scene.
pub struct Page {
    /// Surfels, the trailing parts of their centres, how many each stands for, their colours, the bounding balls of their batches:
    /// as far as the render needs them.
    pub buffers: Named,
    /// Surfels in it.
    pub surfels: u64,
    /// Surfels that they stand for together.
    pub stand_for: u64,
}

/// Uploads `scene` as far as `needs` asks for it, in the [`order`] that draws well where its `core` is given, or as it is.
pub fn upload(
    gpu: &Gpu,
    scene: &Scene,
    needs: &SceneNeeds,
    core: Option<&Bounds>,
    progress: &dyn Progress,
) -> Result<Uploaded> {
    progress.begin("uploading surfels", scene.surfels.len() as u64);
    let given = || (0..scene.surfels.len() as u32).collect();
    let mut order = core.map_or_else(given, |core| order(scene, core));
    let copies = needs.copies.then(|| copies(scene));
    if let Some(copies) = &copies {
        order.retain(|&index| copies[index as usize] > 0);
    }
    let pages = order.chunks(page_surfels(&gpu.adapter) as usize);
    let pages = pages.map(|indices| page(gpu, scene, needs, (indices, copies.as_deref()), progress));
    let pages = pages.collect::<Result<_>>()?;
    let shared = shared(gpu, scene, needs)?;
    progress.end();
    Ok(Uploaded { pages, shared, order })
}

/// The page of the surfels at `indices`, of which each stands for its `copies`.
fn page(
    gpu: &Gpu,
    scene: &Scene,
    needs: &SceneNeeds,
    (indices, copies): (&[u32], Option<&[u32]>),
    progress: &dyn Progress,
) -> Result<Page> {
    let surfels = Buffer::storage(gpu, "surfels", indices.len() as u64)?;
    surfels.write(gpu, indices.len(), |range| taken(&scene.surfels, &indices[range]), progress)?;
    let mut buffers = vec![("surfels", surfels.words())];
    if needs.doubled {
        buffers.push(("centers_low", stored(gpu, "trailing parts of centres", &scene.low, indices)?));
    }
    if let Some(copies) = copies {
        buffers.push(("copies", stored(gpu, "numbers of copies", copies, indices)?));
    }
    buffers.extend(colors(gpu, scene, needs.color, indices)?.map(|colors| ("colors", colors)));
    let batches: Vec<_> = indices
        .par_chunks(BATCH as usize)
        .map(|batch| ball(batch.iter().map(|&i| (scene.center(i as usize), &scene.surfels[i as usize]))))
        .collect();
    let balls = Buffer::storage(gpu, "batches", batches.len() as u64)?;
    balls.write(gpu, batches.len(), |range| batches[range].into(), &())?;
    buffers.push(("balls", balls.words()));
    let all = indices.len() as u64;
    let stand_for = copies.map_or(all, |copies| indices.iter().map(|&index| u64::from(copies[index as usize])).sum());
    Ok(Page { buffers, surfels: all, stand_for })
}

/// The colours at `indices`, where surfels differ in them.
fn colors(gpu: &Gpu, scene: &Scene, need: ColorNeed, indices: &[u32]) -> Result<Option<Buffer<u32>>> {
    Ok(match (need, &scene.colors) {
        (ColorNeed::Srgb8, Colors::Srgb8(codes)) => Some(stored(gpu, "colours", codes, indices)?),
        (ColorNeed::Linear, Colors::Linear(colors)) => Some(stored(gpu, "colours", colors, indices)?),
        (ColorNeed::Textured, Colors::Textured(textured)) => {
            let buffer = Buffer::storage(gpu, "colours", indices.len() as u64)?;
            let all = |&index: &u32| {
                let [center, u_slope, v_slope] = textured.mapped(index as usize, scene.low.get(index as usize));
                [textured.colors()[index as usize], center, u_slope, v_slope]
            };
            let values = |range: Range<usize>| indices[range].par_iter().map(all).collect::<Vec<_>>().into();
            buffer.write(gpu, indices.len(), values, &())?;
            Some(buffer.words())
        }
        _ => None,
    })
}

/// The table that decodes 8-bit sRGB, where it is needed, and the texture.
fn shared(gpu: &Gpu, scene: &Scene, needs: &SceneNeeds) -> Result<Named> {
    let mut shared = Vec::new();
    if let ColorNeed::Srgb8 | ColorNeed::Textured = needs.color {
        let table: [[f32; 4]; 64] = std::array::from_fn(|row| std::array::from_fn(|k| SRGB8_TO_LINEAR[4 * row + k]));
        shared.push(("srgb_to_linear", Buffer::uniform(gpu, "sRGB table", &table)?.words()));
    }
    if let Colors::Textured(textured) = &scene.colors {
        let texels = textured.texture().texels();
        let buffer = Buffer::storage(gpu, "the texture", texels.len() as u64)?;
        buffer.write(gpu, texels.len(), |range| texels[range].into(), &())?;
        shared.push(("texels", buffer.words()));
    }
    Ok(shared)
}

/// The `values` at `indices`; `what` names them in an error.
fn stored<T: Pod + Send + Sync>(gpu: &Gpu, what: &str, values: &[T], indices: &[u32]) -> Result<Buffer<u32>> {
    let buffer = Buffer::storage(gpu, what, indices.len() as u64)?;
    buffer.write(gpu, indices.len(), |range| taken(values, &indices[range]), &())?;
    Ok(buffer.words())
}

/// The values at `indices`.
fn taken<'a, T: Pod + Send + Sync>(values: &[T], indices: &[u32]) -> Cow<'a, [T]> {
    indices.par_iter().map(|&index| values[index as usize]).collect::<Vec<_>>().into()
}
