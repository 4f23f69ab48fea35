//! Every struct and constant that host and device share, and nothing else. `wgsl/layout.wgsl` states the layout; the
//! test in `tests/layout` compares it with this mirror field by field.

use bytemuck::{Pod, Zeroable};

use crate::scene::light::MAX_LIGHTS;

/// Invocations of a workgroup, in every kernel.
pub const WORKGROUP: u32 = 64;

/// Words at the start of a page's queue of large splats: how many there are, how many splats are out of view, and two grids of
/// workgroups.
pub const QUEUE_START: u32 = 8;

/// Word of the queue at which the grid starts that has a workgroup for each large splat.
pub const QUEUE_GRID: u32 = 2;

/// Word of the queue at which the grid starts that lists the large splats in tiles, some a workgroup.
pub const QUEUE_LISTING: u32 = 5;

/// Pixels of a tile across (`wgsl/covered.wgsl`).
pub const TILE_WIDTH: u32 = 8;

/// Pixels of a tile down, where its invocations share what they fetch (`wgsl/splat_shared.wgsl`): the more, the fewer tiles fetch the
/// same splat.
pub const TILE_ROWS_SHARED: u32 = 16;

/// Pixels of a tile down elsewhere.
pub const TILE_ROWS_PLAIN: u32 = 8;

/// Words at the start of the list of covered tiles: how many there are, and two grids of workgroups (`wgsl/covered.wgsl`).
pub const COVERED_LIST: u32 = 8;

/// Word of that list at which the grid starts that has a workgroup for each tile.
pub const COVERED_GRID: u32 = 1;

/// Word of that list at which the grid starts that has one for eight tiles.
pub const COVERED_GRID_OF_EIGHTS: u32 = 4;

/// Words at the start of the lists of tiles: what they needed.
pub const LIST_ENDS: u32 = 2;

/// Side of the blocks of tiles that share a list of large splats, pixels.
pub const BLOCK_SIDE: u32 = 16;

/// The most workgroups per dimension that every adapter grants.
pub const MOST_GROUPS: u32 = 65_535;

/// The most pixels that one invocation may visit for one splat: llvmpipe ends loops after 65,535 rounds.
pub const MOST_ROUNDS: u32 = 32_768;

/// Invocations of a workgroup that draws a large splat: a square of 16.
pub const TILE: u32 = 16;

/// Surfels of a batch: consecutive in memory, and left out together (`wgsl/cull.wgsl`).
pub const BATCH: u32 = 64;

/// Surfels of a run, which are dealt out together: whole batches. Of 64, 512 and 4096 the middle gave the shortest frames on a software adapter.
pub const RUN: u32 = 512;

/// Words of the state of a cut (`wgsl/select.wgsl`): where the grids of nodes that are judged and of nodes that are spread start, of which the latter
/// is last.
pub const JUDGE_GRID: u32 = 4;
/// See [`JUDGE_GRID`].
pub const SPREAD_GRID: u32 = 7;

/// Nodes that one invocation judges (`wgsl/select.wgsl`). Cuts of 15,000 and of 330,000 nodes were made in the shortest time by 8 and 16 of 1, 4, 8, 16
/// and 32 on a software adapter.
pub const JUDGED: u32 = 8;

/// The lowest bit of [`TreeNode::below`] that says of what kind a node is.
pub const KIND_SHIFT: u32 = 30;

/// A node with children.
pub const INNER: u32 = 0;

/// A node with surfels.
pub const LEAF: u32 = 1;

/// A node that leads to a root of another branch.
pub const OTHER_BRANCH: u32 = 2;

/// One that has some surfels of a leaf.
pub const PART_OF_LEAF: u32 = 3;

/// Words at the start of a list of batches: a grid of workgroups that draws all of them, and one that draws the far ones.
pub const LIST_START: u32 = 6;

/// Word of that list at which the grid of the far ones starts.
pub const LIST_FAR: u32 = 3;

/// Side of the tiles by which hidden splats are told, pixels.
pub const OCCLUSION_TILE: u32 = 8;

/// Units of a weight of 1 in the sums of the accumulator `fixed`: as many as a word holds, of which f32 and the least
/// weight keep every digit.
pub const ONE: u32 = u32::MAX - 1023;

/// Bit of [`Splat::bounds_last`] that says that s x t points away from the viewer.
pub const AWAY: u32 = 1 << 31;

/// The camera, options and facts of one render, as the kernels see them. See the WGSL for the meaning of each field.
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
}

/// The rows of the image that the per-pixel buffers hold at a time.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Band {
    /// Row of the image that is row 0 of the buffers.
    pub first_row: u32,
    /// Rows held.
    pub rows: u32,
    /// Always 0.
    pub padding_0: u32,
    /// Always 0.
    pub padding_1: u32,
}

/// A projected surfel; see the WGSL.
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

/// A page of surfels; see the WGSL.
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

/// A node of a tree; see the WGSL.
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

/// Neighbouring subtrees of a tree; see the WGSL.
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

/// What a low-pass needs of a splat; see `wgsl/filter.wgsl`.
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
