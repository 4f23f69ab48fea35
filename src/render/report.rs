//! What a render did, and what it took.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::frame::Frame;
use crate::scene::Map;

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
    /// Surfels and nodes that are drawn in place of all surfels, of a scene with levels of detail.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut: Option<u64>,
    /// Triangles in the scene.
    #[serde(skip_serializing_if = "is_none")]
    pub triangles: u64,
    /// Image width.
    pub width: u32,
    /// Image height.
    pub height: u32,
    /// Milliseconds by pass, `NAME_ms`, of all tries together.
    pub passes: BTreeMap<String, f64>,
    /// Where the passes' times come from: `timestamps` or `wall`.
    pub clock: &'static str,
    /// Milliseconds from the uploaded scene to the frame in host memory.
    pub total_ms: f64,
    /// What the scene needed.
    pub needs: Vec<&'static str>,
    /// Of the map [`Map::Tail`](crate::scene::Map::Tail), if it is made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tail: Option<Tail>,
}

fn is_none(count: &u64) -> bool {
    *count == 0
}

/// How much of a picture is what lies behind the last layer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tail {
    /// The mean of its weights over all pixels: 1 would be a picture of nothing else.
    pub mean: f64,
    /// The largest weight at a pixel.
    pub largest: f64,
}

impl Tail {
    pub(super) fn of(frame: &Frame) -> Option<Self> {
        let weights = frame.map(Map::Tail)?.iter().map(|weight| f64::from(*weight));
        let mean = weights.clone().sum::<f64>() / frame.color.len().max(1) as f64;
        Some(Self { mean, largest: weights.fold(0.0, f64::max) })
    }
}

/// Device memory of a render, bytes: its buffers and textures, and what the host reads frames through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceBytes {
    /// Of the surfels and their splats.
    pub splats: u64,
    /// Of the pixels: nearest depths, sums, image.
    pub pixels: u64,
}
