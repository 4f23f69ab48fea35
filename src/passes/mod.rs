//! The stages, a file each: the equation with its source, the f64 twin (`reference`) and the GPU's recording
//! (`steps`), and its row (`PASS`). The order of a frame is [`render::sequence`](crate::render).
//!
//! | stage | takes | makes |
//! |---|---|---|
//! | [`order`] | [`Scene`](crate::scene::Scene) | the order of its surfels in memory |
//! | [`upload`] | [`Scene`](crate::scene::Scene) | pages of surfels |
//! | [`cull`] | surfels, nearest depths so far | the batches that are projected |
//! | [`project`] | surfels | [`splat::Splat`] each |
//! | [`visibility`] | splats | the nearest depth of each pixel |
//! | [`accumulate`] | splats, nearest depths | [`accumulate::PixelSums`] |
//! | [`tiles`] | large splats, or all | the same two, or the next |
//! | [`covered`] | nearest depths | the tiles that have anything |
//! | [`resolve`] | sums | [`Frame`](crate::frame::Frame) |
//!
//! [`unseen`] says why none of them shows where none does.
//!
//! [`footprint`] is evaluated inside visibility and accumulate, with the [`homography`] and the [`lowpass`] that [`project`] prepared,
//! and the [`attributes`] that are blended; [`shared`] is what every kernel has.

pub mod accumulate;
pub mod attributes;
pub mod covered;
pub mod cull;
pub mod footprint;
pub mod homography;
pub mod lowpass;
pub mod order;
pub mod project;
pub mod raster;
pub mod resolve;
pub mod shared;
pub mod splat;
pub mod tiles;
pub mod unseen;
pub mod upload;
pub mod visibility;

use crate::plan::SceneNeeds;
use crate::plan::pass::{Making, Module, Pass};

/// The passes whose files every module has.
const PASSES: [&Pass; 11] = [
    &shared::PASS,
    &project::PASS,
    &cull::PASS,
    &lowpass::PASS,
    &footprint::PASS,
    &visibility::PASS,
    &accumulate::PASS,
    &attributes::PASS,
    &covered::PASS,
    &resolve::PASS,
    &raster::PASS,
];

/// The modules that a render with `needs` is made of: the first, and that of the tiles, if there are any.
pub fn modules(needs: &SceneNeeds) -> Vec<Module> {
    let with = |own: &Pass| PASSES.iter().flat_map(|pass| (pass.files)(needs)).chain((own.files)(needs)).collect();
    let first = Module {
        files: with(&accumulate::SUMS),
        kernels: PASSES.iter().flat_map(|pass| (pass.kernels)(needs)).collect(),
    };
    let tiles = || Module { files: with(&tiles::PASS), kernels: (tiles::PASS.kernels)(needs) };
    std::iter::once(first).chain(needs.tiles.then(tiles)).collect()
}

/// The overridable constants of a render, by name.
pub fn constants(making: &Making<'_>) -> Vec<(&'static str, f64)> {
    PASSES.iter().flat_map(|pass| (pass.constants)(making)).collect()
}
