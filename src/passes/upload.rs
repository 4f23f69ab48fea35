//! Stage 0: uploads the surfels of a [`Source`] to the device, in pages that fit a binding.

use std::ops::Range;

use bytemuck::Zeroable;
use rayon::prelude::*;

use super::branches::{self, Branch};
use super::source::{self, Source};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::layout::{self, BATCH, BOX_WORDS, QUEUE_START, TreeNode};
use crate::passes::triangles::CORNER_WORDS;
use crate::plan::{ColorNeed, Facts, MeshNeeds, SceneNeeds, SurfelLayout, page_surfels, texture_words};
use crate::progress::Progress;
use crate::scene::color::SRGB8_TO_LINEAR;
use crate::scene::hierarchy::Hierarchy;
use crate::scene::{Mipmap, Surfel, Triangles};

/// Buffers with their names in WGSL.
pub type Named = Vec<(&'static str, Buffer<u32>)>;

/// The scene on a device.
pub struct Uploaded {
    /// Consecutive surfels; kernels see one page at a time.
    pub pages: Vec<Page>,
    /// The place of the first surfel in the stored order of the whole scene.
    pub first: u32,
    /// The branches of the levels of detail, if a cut is drawn. Then `pages` is empty: pages are
    /// made once the size of the cut is known.
    pub branches: Vec<BranchBuffers>,
    /// Buffers that exist once: the table that decodes 8-bit sRGB, the textures and the triangles.
    pub shared: Named,
}

/// The buffers of one branch of a tree.
pub struct BranchBuffers {
    /// The branch's surfels and nodes, with the attributes that the render needs.
    pub buffers: Named,
    /// The number of the branch's levels that are too large for one workgroup.
    pub large_levels: u32,
    /// The number of nodes.
    pub nodes: u64,
    /// The word of the buffer `attributes` at which the list of chosen surfels starts.
    pub chosen: u32,
    /// The number of roots.
    pub roots: u64,
}

/// One page of a scene.
pub struct Page {
    /// Surfels, the attributes that the render needs, and the bounding balls of the batches.
    pub buffers: Named,
    /// The number of each surfel in the source.
    pub numbers: Vec<u32>,
    /// The number of surfels that the page stands for, copies included.
    pub stand_for: u64,
}

/// Uploads the parts of `source` that `needs` asks for, reordered for drawing if `ordered`.
pub fn upload(
    gpu: &Gpu,
    source: &dyn Source,
    needs: &SceneNeeds,
    (facts, ordered): (&Facts, bool),
    progress: &dyn Progress,
) -> Result<Uploaded> {
    progress.begin("uploading surfels", facts.surfels);
    if needs.levels {
        let branches = branches(gpu, source, needs, progress)?;
        progress.end();
        return Ok(Uploaded { pages: Vec::new(), first: 0, branches, shared: shared(gpu, source, needs)? });
    }
    let pages = source.pages(needs, page_surfels(&gpu.adapter, needs) as usize, ordered.then_some(facts));
    let pages = pages.into_iter().map(|of| page(gpu, &*of, needs, progress)).collect::<Result<_>>()?;
    let shared = shared(gpu, source, needs)?;
    progress.end();
    Ok(Uploaded { pages, first: source.first(), branches: Vec::new(), shared })
}

/// Uploads the branches of the levels of detail of `source`.
fn branches(gpu: &Gpu, source: &dyn Source, needs: &SceneNeeds, progress: &dyn Progress) -> Result<Vec<BranchBuffers>> {
    let words = SurfelLayout::of(needs).words as usize;
    // Words per chosen surfel: its number and, with fades, its fade. The list of chosen surfels
    // starts with a word that counts them.
    let of_chosen = if needs.fades { 2 } else { 1 };
    let most = gpu.adapter.page_len(size_of::<Surfel>().max(4 * (words + of_chosen))).saturating_sub(1);
    let tree = source.levels().ok_or_else(|| gpu.error("a scene has no levels of detail"))?;
    let of = |branch: Branch| {
        let page = source.branch(needs, &branch).ok_or_else(|| gpu.error("a scene has no levels of detail"))?;
        let tree_nodes = rows_of(gpu, tree, &branch)?;
        let Branch { surfels, nodes, roots, first_root, whole, levels, small_levels, .. } = branch;
        let (surfels, records) = (surfels.len() as u32, surfels.len() + nodes.len());
        let chosen = (records * words) as u32;
        let whole = whole.into();
        let own = layout::Branch { surfels, roots, first_root, whole, chosen, small_levels, ..Zeroable::zeroed() };
        let boxes = records.div_ceil(BATCH as usize) as u64 * u64::from(BOX_WORDS);
        let mut buffers = vec![
            ("branch", Buffer::uniform(gpu, "branch", &own)?.words()),
            ("boxes", Buffer::storage(gpu, "batches of a cut", boxes)?),
            ("tree_nodes", tree_nodes),
        ];
        buffers.extend(RECORDS.into_iter().zip(records_of(
            gpu,
            (&*page, records),
            (words, 1 + of_chosen * records),
            progress,
        )?));
        Ok(BranchBuffers {
            buffers,
            large_levels: levels - small_levels,
            nodes: nodes.len() as u64,
            chosen,
            roots: roots.into(),
        })
    };
    branches::branches(tree, most).into_iter().map(of).collect()
}

/// Uploads the rows of a branch of `tree`. The rows are made while they are written, because
/// allocating all of them at once takes time.
fn rows_of(gpu: &Gpu, tree: &Hierarchy, branch: &Branch) -> Result<Buffer<u32>> {
    let count = branch.nodes.len();
    let row = |index: usize| branch.row(tree, index);
    let rows = |range: Range<usize>| range.into_par_iter().with_min_len(4096).map(row).collect::<Vec<_>>().into();
    let buffer = Buffer::<TreeNode>::writable(gpu, "nodes", count as u64)?;
    buffer.write(gpu, count, rows, &())?;
    Ok(buffer.words())
}

fn page(gpu: &Gpu, of: &dyn source::Page, needs: &SceneNeeds, progress: &dyn Progress) -> Result<Page> {
    let numbers = of.numbers().into_owned();
    let words = SurfelLayout::of(needs).words as usize;
    let records = records_of(gpu, (of, numbers.len()), (words, 0), progress)?;
    let mut buffers: Named = RECORDS.into_iter().zip(records).collect();
    let batches = of.balls();
    let balls = Buffer::writable(gpu, "batches", batches.len() as u64)?;
    balls.write(gpu, batches.len(), |range| batches[range].into(), &())?;
    buffers.push(("balls", balls.words()));
    Ok(Page { buffers, numbers, stand_for: of.stand_for() })
}

/// The names of the buffers that hold surfel records.
const RECORDS: [&str; 2] = ["surfels", "attributes"];

/// Uploads `count` surfels of a page and their attributes, `words` each, with `behind` more words
/// after them.
///
/// There is no attribute buffer if it would be empty.
fn records_of(
    gpu: &Gpu,
    (of, count): (&dyn source::Page, usize),
    (words, behind): (usize, usize),
    progress: &dyn Progress,
) -> Result<Vec<Buffer<u32>>> {
    let surfels = Buffer::writable(gpu, "surfels", count as u64)?;
    surfels.write(gpu, count, |range| of.surfels(range).into(), progress)?;
    let mut buffers = vec![surfels.words()];
    if words + behind > 0 {
        let attributes = Buffer::writable(gpu, "attributes", (count * words + behind) as u64)?;
        // The range of words may start and end within a record.
        let values = |range: Range<usize>| {
            let mut values = of.attributes(range.start / words..range.end.div_ceil(words));
            values.drain(..range.start % words);
            values.truncate(range.len());
            values.into()
        };
        attributes.write(gpu, count * words, values, &())?;
        buffers.push(attributes);
    }
    Ok(buffers)
}

/// Uploads the buffers that exist once: the sRGB table if it is needed, the textures and the
/// triangles.
pub fn shared(gpu: &Gpu, source: &dyn Source, needs: &SceneNeeds) -> Result<Named> {
    let mut shared = Vec::new();
    let textured = needs.mesh.is_some_and(|mesh| mesh.textured);
    if textured || matches!(needs.color, ColorNeed::Srgb8 | ColorNeed::Textured) {
        let table: [[f32; 4]; 64] = std::array::from_fn(|row| std::array::from_fn(|k| SRGB8_TO_LINEAR[4 * row + k]));
        shared.push(("srgb_to_linear", Buffer::uniform(gpu, "sRGB table", &table)?.words()));
    }
    let paint = source.triangles().filter(|_| textured).map_or(&[][..], |triangles| triangles.textures());
    let own = source.textures();
    if !own.is_empty() || !paint.is_empty() {
        let all: Vec<&Mipmap> = own.iter().chain(paint).collect();
        shared.push(("textures", filled(gpu, "textures", &texture_words(&all))?));
    }
    if let (Some(triangles), Some(mesh)) = (source.triangles(), needs.mesh) {
        shared.extend(of_triangles(gpu, triangles, &mesh, own.len() as u32)?);
    }
    Ok(shared)
}

/// The buffers of triangles: vertices, corners and attributes, and space for projected corners and
/// for the queues of large and rare triangles.
///
/// `textures` is the number of the surfels' textures, which precede those of the triangles.
fn of_triangles(gpu: &Gpu, triangles: &Triangles, mesh: &MeshNeeds, textures: u32) -> Result<Named> {
    let (vertices, corners) = (triangles.vertices(), triangles.corners());
    let queue = corners.len() as u64 + u64::from(QUEUE_START);
    let seen = vertices.len() as u64 * u64::from(CORNER_WORDS);
    Ok(vec![
        ("vertices", filled(gpu, "vertices of triangles", bytemuck::cast_slice(&mesh.places(triangles)))?),
        ("triangles", filled(gpu, "triangles", bytemuck::cast_slice(corners))?),
        (
            "triangle_attributes",
            filled(gpu, "attributes of triangles", bytemuck::cast_slice(&mesh.records(triangles, textures)))?,
        ),
        ("corners", Buffer::storage(gpu, "corners of triangles", seen)?),
        ("large_triangles", Buffer::indirect(gpu, "queue of large triangles", queue)?),
        ("rare_triangles", Buffer::indirect(gpu, "list of rare triangles", queue)?),
    ])
}

/// Creates a buffer named `what` that holds `words`.
fn filled(gpu: &Gpu, what: &str, words: &[u32]) -> Result<Buffer<u32>> {
    let buffer = Buffer::writable(gpu, what, words.len() as u64)?;
    buffer.write(gpu, words.len(), |range| words[range].into(), &())?;
    Ok(buffer)
}
