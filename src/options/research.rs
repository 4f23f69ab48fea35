//! Choices that change speed or error and that a picture rarely needs: for studies and comparisons.

use super::group::group;
use crate::gpu::Replacement;
use crate::plan::{Accumulator, BlendFormat, Optimisation, Organisation, RasterDepth};
use crate::scene::{DetailMeasure, NodeShape, Outline, ShadingAt};

group! {
    /// Choices that change speed or error and that a picture rarely needs.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Research"))]
    pub struct ResearchOptions {
        /// How the device keeps sums: fixed, fixed32, fixed64, packed64, float or cas
        /// [default: fixed]
        #[cfg_attr(feature = "cli", arg(long, value_name = "NAME", hide_short_help = true))]
        pub accumulator: Option<Accumulator>,
        /// How the device draws splats, to the same bits: scatter (one by one), tile (by tiles of
        /// the image) or auto (by size and adapter) [default: auto]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", hide_short_help = true))]
        pub organisation: Option<Organisation>,
        /// Optimisations that are left out; none changes a bit of the picture
        #[cfg_attr(feature = "cli", arg(long, value_name = "NAMES", value_delimiter = ',', hide_short_help = true))]
        pub without: Vec<Optimisation>,
        /// A WGSL file of one's own in place of a built-in one: FILE=PATH, such as
        /// kernel_ellipse.wgsl=mine.wgsl
        ///
        /// A blending kernel is evaluated in f64 too, for the reference, and weights that are NaN,
        /// infinite, negative or above 1 are counted
        #[cfg_attr(feature = "cli", arg(long = "source", value_name = "FILE=PATH", hide_short_help = true))]
        pub sources: Vec<Replacement>,
        /// Target of --backend raster: rgba8unorm, rgba16float or rgba32float
        /// [default: rgba16float]
        #[cfg_attr(feature = "cli", arg(long, value_name = "FORMAT", hide_short_help = true))]
        pub blend_format: Option<BlendFormat>,
        /// Depth test of --backend raster: exact (in the shader) or offset (by the rasteriser)
        /// [default: exact]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", hide_short_help = true))]
        pub raster_depth: Option<RasterDepth>,
        /// Where light falls: pixel (at its blended normal) or splat (at its centre; lit colours
        /// are blended) [default: pixel]
        #[cfg_attr(feature = "cli", arg(long, value_name = "WHAT", hide_short_help = true))]
        pub shading_at: Option<ShadingAt>,
        /// Draw a polygon of N sides, 3 to 16, in each disk in place of the disk
        #[cfg_attr(feature = "cli", arg(long, value_name = "N", hide_short_help = true))]
        pub outline: Option<Outline>,
        /// Measure of nodes for --lod: extent (the ball around all below a node) or area (its
        /// image, as in Pajarola 2003) [default: extent]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", requires = "cut", hide_short_help = true))]
        pub lod_measure: Option<DetailMeasure>,
        /// Shape of nodes: cap (curved as the surface below them) or disk [default: cap]
        #[cfg_attr(feature = "cli", arg(long, value_name = "SHAPE", requires = "cut", hide_short_help = true))]
        pub lod_shape: Option<NodeShape>,
    }
}
