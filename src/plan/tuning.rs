//! Thresholds above which a method is faster, each with its measurement. No image depends on them.
//!
//! All were measured on Mesa 22.3's llvmpipe, a software adapter, at 1024x1024. None was measured
//! on a graphics card yet.

use super::{Fetch, Optimisation, Organisation, Settings};
use crate::gpu::adapter::AdapterDescription;

/// Batches are culled if there is more than one surfel per this many pixels. With culling, frames
/// of 300,000 splats take 0.86 times as long, frames of 100,000 splats 1.08 times, and frames of
/// 1,000 small splats 1.13 times.
pub const PIXELS_A_CULLED_SURFEL: u64 = 6;

/// The same for batches of a cut, whose surfels are read by way of a list. With culling, frames of
/// cuts of 9,000,000 and of 1,000,000 splats of a sphere take 0.7 and 0.85 times as long, and
/// frames of 440,000 splats of the Dragon 1.04 times.
pub const PIXELS_A_CULLED_CHOICE: u64 = 2;

/// The rasteriser draws a triangle per splat instead of a quad if there is more than one surfel per
/// this many pixels. Triangles take 0.6 times as long as quads for 1,000,000 splats, equally long
/// for 100,000, and 1.2 times as long for 10,000.
pub const PIXELS_A_TRIANGLE: u64 = 10;

/// Tiles sum all splats if a splat touches at least this many tiles on average. By tiles, frames of
/// 1,000,000 splats that touch 1.4, 1.9 and 2.2 tiles take 1.5, 1.1 and 0.96 times as long as by
/// scatter. Frames of 300,000 splats that touch 2.8 tiles take 0.82 times as long.
pub const GATHERED_TOUCHED_TILES: f64 = 2.0;

/// Splats whose bounds hold more pixels than this are drawn by tiles. Among 64, 128, 256, 512 and
/// 1024 this value gave the shortest frames for 30,000 and for 100,000 splats of a sphere.
pub const LARGE_BY_TILES: u32 = 256;

/// Without tiles, splats whose bounds hold more pixels than this get a workgroup each instead of an
/// invocation.
pub const LARGE_BY_WORKGROUPS: u32 = 1024;

/// The most bytes of fragments on the device at a time; an image with more is drawn in more bands.
pub const MOST_FRAGMENT_BYTES: u64 = 1 << 29;

/// Rows per strip, which one thread of the f64 reference renders at a time.
pub const REFERENCE_ROWS: u32 = 8;

/// Whether workgroups sum fragments in their memory before they add them to the image
/// (`wgsl/accumulate/accumulate_spread.wgsl`): on graphics cards, whose workgroups have memory of
/// their own of at least 32 KiB. Processors have none; llvmpipe takes minutes to compile the
/// kernel. By the f32 twin's counts the atomic operations on sums are 0.43 to 0.46 times as many
/// (`tests/kernels/spread.rs`). A Radeon card (RDNA 2) keeps 10 of 32 waves instead of 20, because
/// of the memory (`tests/golden/registers.txt`); which counts more was not measured on a card.
pub fn spreads(adapter: &AdapterDescription) -> bool {
    !adapter.is_software() && adapter.max_compute_workgroup_storage_size >= 1 << 15
}

/// The largest number of pixels that one invocation draws as a small splat: software adapters end
/// the loops of an invocation after 65,535 rounds.
pub const MOST_LARGE: u32 = 4096;

/// The number of pixels above which the bounds of a splat make it large, with or without `tiles`.
pub fn large(tiles: bool, options: &Settings) -> u32 {
    options.large.unwrap_or(match (tiles, options.organisation) {
        (true, Organisation::Tile) => 0,
        (true, _) => LARGE_BY_TILES,
        (false, _) => LARGE_BY_WORKGROUPS,
    })
}

/// Whether two kernels project small splats and draw their nearest depths. On llvmpipe one kernel
/// takes 1.17 times as long as the two for 100,000 splats of a sphere.
pub fn splits(adapter: &AdapterDescription, wanted: bool) -> bool {
    adapter.is_software() && wanted
}

/// How the invocations of a tile get splats. A processor should fetch a splat once for all the
/// pixels of a column: on the bunny llvmpipe takes 100 times as long with a pixel an invocation. A
/// graphics card (RDNA 2, by Mesa's compiler) keeps 4 of 32 waves with the registers of a column,
/// 16 with those of a pixel, and 12 if surfels are curved (`tests/golden/registers.txt`).
pub fn fetch(adapter: &AdapterDescription, options: &Settings) -> Fetch {
    let shares = adapter.subgroups && options.has(Optimisation::Sharing);
    options.fetch.unwrap_or(match (adapter.is_software(), shares) {
        (false, _) => Fetch::Staged,
        (true, true) => Fetch::Shared,
        (true, false) => Fetch::Alone,
    })
}
