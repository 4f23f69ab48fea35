//! The structs and constants that host and device share, and nothing else.
//!
//! `wgsl/common/layout.wgsl` defines the layout; `tests/kernels/layout` compares it with this
//! mirror field by field.

use bytemuck::{Pod, Zeroable};

use crate::scene::light::MAX_LIGHTS;

/// Invocations of a workgroup in most kernels that number them in one dimension.
pub const WORKGROUP: u32 = 64;

/// Words at the start of a page's queue of large splats: the number of large splats, the number of
/// splats out of view, and two grids of workgroups.
pub const QUEUE_START: u32 = 8;

/// First word of the queue's grid with one workgroup per large splat.
pub const QUEUE_GRID: u32 = 2;

/// First word of the queue's grid for listing large splats in tiles, with several splats per
/// workgroup.
pub const QUEUE_LISTING: u32 = 5;

/// Width of a tile, pixels, whose invocations share the splats that they fetch by subgroups
/// (`wgsl/tiles/splat_shared.wgsl`); also the number of these invocations.
pub const TILE_WIDTH: u32 = 8;

/// Words at the start of the list of covered tiles: the number of tiles, and two grids of
/// workgroups (`wgsl/visibility/covered.wgsl`).
pub const COVERED_LIST: u32 = 8;

/// First word of the grid with one workgroup per tile, in the list of covered tiles.
pub const COVERED_GRID: u32 = 1;

/// First word of the grid with one workgroup per eight tiles, in the list of covered tiles.
pub const COVERED_GRID_OF_EIGHTS: u32 = 4;

/// Side of the square of occlusion tiles whose farthest depths a workgroup finds, in such tiles.
pub const OCCLUSION_BLOCK: u32 = 8;

/// Words at the start of the tile lists: the greatest length so far of all lists together, and of
/// one list (`wgsl/tiles/bin.wgsl`).
pub const LIST_ENDS: u32 = 2;

/// Side of the blocks of tiles that share a list of large splats, pixels.
pub const BLOCK_SIDE: u32 = 16;

/// The number of workgroups per dimension that every adapter grants.
pub const MOST_GROUPS: u32 = 65_535;

/// The most pixels that one invocation may visit for one splat: llvmpipe ends loops after 65,535
/// rounds.
pub const MOST_ROUNDS: u32 = 32_768;

/// Side of the square workgroup that draws a large splat, in invocations.
pub const TILE: u32 = 16;

/// Surfels of a batch: consecutive in memory, and culled together (`wgsl/visibility/cull.wgsl`).
pub const BATCH: u32 = 64;

/// Surfels of a run: consecutive whole batches. Runs are shuffled over a page, and keep their inner
/// order. Of 64, 512 and 4096, this gave the shortest frames on a software adapter.
pub const RUN: u32 = 512;

/// First word of the grid of select_judge(), in the state of a cut (`wgsl/levels/select.wgsl`).
pub const JUDGE_GRID: u32 = 4;
/// First word of the grid of select_spread(), the last grid in the state of a cut; see
/// [`JUDGE_GRID`].
pub const SPREAD_GRID: u32 = 7;

/// Nodes that one invocation judges (`wgsl/levels/select.wgsl`). Of 1, 4, 8, 16 and 32 on a
/// software adapter, 8 was fastest for cuts of 15,000 nodes and 16 for cuts of 330,000.
pub const JUDGED: u32 = 8;

/// Lowest bit of the node's kind in [`TreeNode::below`].
pub const KIND_SHIFT: u32 = 30;

/// Kind of a node with children.
pub const INNER: u32 = 0;

/// Kind of a node with surfels.
pub const LEAF: u32 = 1;

/// Kind of a node that leads to a root of another branch.
pub const OTHER_BRANCH: u32 = 2;

/// Kind of a node that has a part of a leaf's surfels.
pub const PART_OF_LEAF: u32 = 3;

/// Words at the start of a list of batches: a grid of workgroups over all batches, and one over the
/// far batches (`wgsl/visibility/cull.wgsl`).
pub const LIST_START: u32 = 6;

/// First word of the grid over the far batches, in a list of batches.
pub const LIST_FAR: u32 = 3;

/// Words of the box around a batch of a cut (`wgsl/levels/balls_cut.wgsl`).
pub const BOX_WORDS: u32 = 6;

/// Side of the tiles of the occlusion test, pixels (`wgsl/visibility/occlusion.wgsl`).
pub const OCCLUSION_TILE: u32 = 8;

/// Units of a weight of 1 in the sums of the accumulator `fixed`: 2^32 - 2^10. It fits one word, is
/// exact in f32, and its product with [`LEAST_AT_RIM`](crate::scene::kernel::LEAST_AT_RIM), 2^-10,
/// is an integer.
pub const ONE: u32 = u32::MAX - 1023;

/// Bit of [`Splat::bounds_last`] that is set if s x t points away from the viewer.
pub const AWAY: u32 = 1 << 31;

/// Camera, options and facts of one render, for the kernels. `src/plan/view.rs` fills it, and
/// `wgsl/common/layout.wgsl` explains the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct View {
    pub rotation: [[f32; 4]; 3],
    pub rotation_low: [[f32; 4]; 3],
    pub eye: [f32; 4],
    pub eye_low: [f32; 4],
    pub intrinsics: [f32; 4],
    pub intrinsics_low: [f32; 4],
    pub color_low: [f32; 4],
    pub color_span: [f32; 4],
    pub color_scale: [f32; 4],
    pub background: [f32; 4],
    pub lights: [[f32; 4]; MAX_LIGHTS],
    pub width: u32,
    pub height: u32,
    pub zero: u32,
    pub unit: f32,
    pub near: f32,
    pub epsilon_relative: f32,
    pub epsilon_absolute: f32,
    pub world: f32,
    pub epsilon_radius: f32,
    pub epsilon_deepest: f32,
    pub farthest: f32,
    pub middle: f32,
    pub epsilon_most: f32,
    pub first: f32,
    pub last: f32,
    pub textures: u32,
    pub place: [f32; 4],
    pub levels: [f32; 4],
    pub atlas: [f32; 4],
    pub lens: [[f32; 4]; 7],
}

/// The rows of the image that the per-pixel buffers hold at a time.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Band {
    /// Row of the image that is row 0 of the buffers.
    pub first_row: u32,
    /// Number of rows.
    pub rows: u32,
    /// Always 0.
    pub padding_0: u32,
    /// Always 0.
    pub padding_1: u32,
}

/// A projected surfel; `wgsl/common/layout.wgsl` explains the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Splat {
    pub anchor_x: i32,
    pub anchor_y: i32,
    pub bounds_first: u32,
    pub bounds_last: u32,
    pub a: [f32; 3],
    pub b: [f32; 3],
    pub c: [f32; 3],
    pub a_low: [f32; 3],
}

/// A page of surfels; `wgsl/common/layout.wgsl` explains the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Page {
    pub first: u32,
    pub surfels: u32,
    pub runs: u32,
    pub stride: u32,
    pub chosen: u32,
    pub padding_0: u32,
    pub padding_1: u32,
    pub padding_2: u32,
}

/// A node of a tree; `wgsl/common/layout.wgsl` explains the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct TreeNode {
    pub center: [f32; 3],
    pub radius: f32,
    pub first: u32,
    pub below: u32,
    pub children: f32,
    pub cone: f32,
}

/// A branch of a tree, which consists of neighbouring subtrees; `wgsl/common/layout.wgsl` explains
/// the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Branch {
    pub surfels: u32,
    pub roots: u32,
    pub first_root: u32,
    pub whole: u32,
    pub chosen: u32,
    pub small_levels: u32,
    pub padding_0: u32,
    pub padding_1: u32,
}

/// Input of the low-pass for one splat; `wgsl/project/filter.wgsl` explains the fields.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Filter {
    pub center_x: f32,
    pub center_y: f32,
    pub depth_low: f32,
    pub depth_high: f32,
    pub r_xx: f32,
    pub r_xy: f32,
    pub r_yy: f32,
    pub gain: f32,
}
