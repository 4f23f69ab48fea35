//! The stages, a file each: the equation with its source, the f64 twin (`reference`) and the GPU's recording
//! (`record`). The types make the order: a stage takes what the one before it made.
//!
//! | stage | takes | makes |
//! |---|---|---|
//! | [`order`] | [`Scene`](crate::scene::Scene) | the order of its surfels in memory |
//! | [`upload`] | [`Scene`](crate::scene::Scene) | [`upload::SurfelBuffer`] |
//! | [`cull`] | surfels, nearest depths so far | the batches that are projected |
//! | [`project`] | surfels | [`project::SplatBuffer`] |
//! | [`visibility`] | splats | [`visibility::VisibilityBuffer`] |
//! | [`accumulate`] | splats, nearest depths | [`accumulate::AttributeBuffer`] |
//! | [`tiles`] | large splats, or all | the same two, or the next |
//! | [`covered`] | nearest depths | the tiles that have anything |
//! | [`resolve`] | sums | [`Frame`](crate::frame::Frame) |
//!
//! [`unseen`] says why none of them shows where none does.
//!
//! [`footprint`] is evaluated inside visibility and accumulate, with the [`homography`] and the [`lowpass`] that [`project`] prepared;
//! [`variant`] says which kernels a render is made of.

pub mod accumulate;
pub mod covered;
pub mod cull;
pub mod footprint;
pub mod homography;
pub mod lowpass;
pub mod order;
pub mod project;
pub mod raster;
pub mod resolve;
pub mod tiles;
pub mod unseen;
pub mod upload;
pub mod variant;
pub mod visibility;

use self::variant::Variant;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::kernel::Program;
use crate::gpu::layout::{Band, View};
use crate::gpu::timing::Timing;

/// What every stage's recording needs.
pub struct Recorder<'a> {
    /// The device.
    pub gpu: &'a Gpu,
    /// Its kernels for this render.
    pub program: &'a Program,
    /// The view uniform.
    pub view: &'a Buffer<View>,
    /// What they were made of.
    pub variant: &'a Variant,
    /// Time per pass.
    pub timing: Timing,
}

/// The rows of the image in work, and their uniform.
pub struct Rows {
    /// First row.
    pub first: u32,
    /// How many.
    pub count: u32,
    /// Pixels in them.
    pub pixels: u64,
    /// Tiles of [`OCCLUSION_TILE`](crate::gpu::layout::OCCLUSION_TILE) pixels squared that cover them.
    pub tiles: u64,
    pub(crate) uniform: Buffer<Band>,
}
