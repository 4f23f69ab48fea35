//! What a render did, and what it took.

use std::collections::BTreeMap;

use serde::Serialize;

/// What a render did.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// `gpu` (compute kernels), `raster` (the rasteriser) or `reference`.
    pub backend: &'static str,
    /// The adapter's name; of the reference, the processor threads.
    pub adapter: String,
    /// How sums were kept: an accumulator, the rasteriser's format, or the reference's `f64`.
    pub accumulator: &'static str,
    /// Fragments that made a sum of the accumulator that was asked for wrap. If any, the frame was rendered again with `fixed`,
    /// and `total_ms` holds both.
    pub overflows: u64,
    /// Surfels in the scene.
    pub surfels: u64,
    /// Splats that may touch a pixel; of an image that is drawn in bands a splat counts in each that it touches, up to as many as there
    /// are surfels. Those that were left out because they are hidden are not counted.
    pub splats_drawn: u64,
    /// Image width.
    pub width: u32,
    /// Image height.
    pub height: u32,
    /// Milliseconds by pass, `NAME_ms`.
    pub passes: BTreeMap<String, f64>,
    /// Where the passes' times come from: `timestamps` or `wall`.
    pub clock: &'static str,
    /// Milliseconds from the uploaded scene to the frame in host memory.
    pub total_ms: f64,
    /// What the scene needed.
    pub needs: Vec<&'static str>,
}

/// Device memory of a render, bytes: its buffers and textures, and what the host reads frames through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceBytes {
    /// Of the surfels and their splats.
    pub splats: u64,
    /// Of the pixels: nearest depths, sums, image.
    pub pixels: u64,
}
