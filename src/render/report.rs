//! The report of a render: what was drawn, how, and how long each pass took.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::frame::Frame;
use crate::gpu::Traffic;
use crate::scene::{KernelFaults, Map};

/// Describes one render: what was drawn, how, and how long it took.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// `gpu` (compute kernels), `raster` (the rasteriser) or `reference`.
    pub backend: &'static str,
    /// The adapter's name; for the reference, the number of processor threads.
    pub adapter: String,
    /// The format of the sums: an accumulator, the rasteriser's format, or the reference's `f64`.
    pub accumulator: &'static str,
    /// Number of fragments that made a sum of the chosen accumulator wrap. If there are any, the
    /// frame was rendered again with `fixed`, and `total_ms` includes both renders.
    pub overflows: u64,
    /// Surfels in the scene.
    pub surfels: u64,
    /// Number of splats that may touch a pixel, without those that were skipped as hidden. In an
    /// image drawn in bands, a splat counts in each band that it touches; the total is at most the
    /// number of surfels.
    pub splats_drawn: u64,
    /// Number of surfels and nodes in the cut, if a cut is drawn instead of all surfels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut: Option<u64>,
    /// Number of triangles in the scene.
    #[serde(skip_serializing_if = "is_none")]
    pub triangles: u64,
    /// Width of the image, pixels.
    pub width: u32,
    /// Height of the image, pixels.
    pub height: u32,
    /// Milliseconds by pass, as `NAME_ms`, summed over all tries.
    pub passes: BTreeMap<String, f64>,
    /// Source of the times of passes: `timestamps` (of the device) or `wall`.
    pub clock: &'static str,
    /// Milliseconds from the uploaded scene to the frame in host memory.
    pub total_ms: f64,
    /// Milliseconds in which kernels were compiled for the adapter since its last report: by
    /// several threads at once, and mostly before `total_ms` begins.
    pub compile_ms: f64,
    /// Submissions, waits and other requests of the host to the device, summed over all tries.
    pub traffic: Traffic,
    /// Names of the needs of scene and options
    /// ([`SceneNeeds::names`](crate::plan::SceneNeeds::names)).
    pub needs: Vec<&'static str>,
    /// Statistics of the map [`Map::Tail`](crate::scene::Map::Tail), if it is written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tail: Option<Tail>,
    /// Counts of wrong weights of a kernel that the user wrote.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub kernel: Option<KernelFaults>,
}

fn is_none(count: &u64) -> bool {
    *count == 0
}

/// How much everything behind the last layer contributes to the picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tail {
    /// The mean weight over all pixels; at 1 the picture would show nothing else.
    pub mean: f64,
    /// The largest weight of a pixel.
    pub largest: f64,
}

impl Tail {
    pub(super) fn of(frame: &Frame) -> Option<Self> {
        let weights = frame.map(Map::Tail)?.iter().map(|weight| f64::from(*weight));
        let mean = weights.clone().sum::<f64>() / frame.color.len().max(1) as f64;
        Some(Self { mean, largest: weights.fold(0.0, f64::max) })
    }
}

/// Device memory of a render in bytes: buffers, textures, and the staging buffers through which
/// frames are read back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceBytes {
    /// Bytes of the surfels and their splats.
    pub splats: u64,
    /// Bytes of the pixels: nearest depths, sums, image.
    pub pixels: u64,
}
