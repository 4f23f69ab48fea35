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
use crate::plan::{ColorNeed, SceneNeeds, SurfelLayout, page_surfels};
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
    /// Surfels, their attributes as far as the render needs them, the bounding balls of their batches.
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
    let pages = order.chunks(page_surfels(&gpu.adapter, needs) as usize);
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
    buffers.extend(attributes(gpu, scene, needs, (indices, copies))?.map(|attributes| ("attributes", attributes)));
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

/// The attributes of the surfels at `indices`, where there are any.
fn attributes(
    gpu: &Gpu,
    scene: &Scene,
    needs: &SceneNeeds,
    (indices, copies): (&[u32], Option<&[u32]>),
) -> Result<Option<Buffer<u32>>> {
    let layout = SurfelLayout::of(needs);
    let words = layout.words as usize;
    if words == 0 {
        return Ok(None);
    }
    let bits = |vectors: &[[f32; 4]], into: &mut [u32]| {
        vectors.iter().flatten().zip(into).for_each(|(value, into)| *into = value.to_bits());
    };
    let record = |index: usize, into: &mut [u32]| {
        match (needs.color, &scene.colors) {
            (ColorNeed::Srgb8, Colors::Srgb8(codes)) => into[0] = u32::from_le_bytes(codes[index]),
            (ColorNeed::Linear, Colors::Linear(colors)) => bits(&[colors[index]], into),
            (ColorNeed::Textured, Colors::Textured(textured)) => {
                let [center, u_slope, v_slope] = textured.mapped(index, scene.low.get(index));
                bits(&[textured.colors()[index], center, u_slope, v_slope], into);
            }
            _ => {}
        }
        if let Some(copies) = copies {
            into[layout.copies as usize] = copies[index];
        }
        if needs.doubled {
            let into = &mut into[layout.low as usize..];
            scene.low[index].iter().zip(into).for_each(|(value, into)| *into = value.to_bits());
        }
    };
    let buffer = Buffer::storage(gpu, "attributes", (indices.len() * words) as u64)?;
    // Of whole records, in which a range of words may start and end anywhere.
    let values = |range: Range<usize>| {
        let (first, last) = (range.start / words, range.end.div_ceil(words));
        let mut values = vec![0; (last - first) * words];
        let records = values.par_chunks_exact_mut(words).zip(&indices[first..last]);
        records.for_each(|(into, index)| record(*index as usize, into));
        values.drain(..range.start - first * words);
        values.truncate(range.len());
        Cow::Owned(values)
    };
    buffer.write(gpu, indices.len() * words, values, &())?;
    Ok(Some(buffer))
}

/// The table that decodes 8-bit sRGB, where it is needed, and the texture.
pub fn shared(gpu: &Gpu, scene: &Scene, needs: &SceneNeeds) -> Result<Named> {
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

/// The values at `indices`.
fn taken<'a, T: Pod + Send + Sync>(values: &[T], indices: &[u32]) -> Cow<'a, [T]> {
    indices.par_iter().map(|&index| values[index as usize]).collect::<Vec<_>>().into()
}
