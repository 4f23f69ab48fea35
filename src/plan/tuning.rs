//! From where on something is worth its cost: every threshold that was measured, and on what. No image depends on one.
//!
//! All were measured on Mesa 22.3's llvmpipe, a software adapter, at 1024x1024; none on a card yet.

use crate::gpu::adapter::AdapterDescription;

/// Batches are culled where there is more than a surfel for so many pixels: frames of 300,000 splats take 0.86 times as long by it, of 100,000 1.08
/// times, of 1,000 small ones 1.13 times.
pub const PIXELS_A_CULLED_SURFEL: u64 = 6;

/// The rasteriser draws a triangle a splat instead of a quad where there is more than a surfel for so many pixels: frames of 1,000,000 splats take 0.6
/// times as long by triangles as by quads, of 100,000 as long, of 10,000 1.2 times.
pub const PIXELS_A_TRIANGLE: u64 = 10;

/// The fewest tiles that a splat touches on average for all to be summed by tiles. Frames of 1,000,000 splats that touch 1.4, 1.9
/// and 2.2 tiles, and of 300,000 that touch 2.8, take 1.5, 1.1, 0.96 and 0.82 times as long by tiles as by scatter.
pub const GATHERED_TOUCHED_TILES: f64 = 2.0;

/// Splats whose bounds hold more pixels than this are drawn by tiles. Of 64, 128, 256, 512 and 1024 this gave the shortest
/// frames of 30,000 and of 100,000 splats of a sphere.
pub const LARGE_BY_TILES: u32 = 256;

/// Where there are no tiles, splats whose bounds hold more pixels than this get a workgroup each instead of an invocation.
pub const LARGE_BY_WORKGROUPS: u32 = 1024;

/// Bytes of the fragments that a device keeps at a time, at most: an image that has more is drawn in more bands.
pub const MOST_FRAGMENT_BYTES: u64 = 1 << 29;

/// Rows that one thread of the f64 reference works on at a time.
pub const REFERENCE_ROWS: u32 = 8;

/// Whether the invocations of a tile share what they fetch: a processor would else fetch it for each of them. A card has caches for
/// that, on which it has not been measured.
pub fn shares(adapter: &AdapterDescription) -> bool {
    adapter.subgroups && adapter.is_software()
}
