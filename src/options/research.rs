//! Choices that change speed or error and that a picture rarely needs: for studies and comparisons.

use super::group::group;
use crate::gpu::Replacement;
use crate::plan::{Accumulator, BlendFormat, Fetch, Optimisation, Organisation, RasterDepth};
use crate::scene::{DetailMeasure, NodeShape, Outline, ShadingAt};

group! {
    /// Choices that change speed or error and that a picture rarely needs.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Research"))]
    pub struct ResearchOptions {
        /// Format of the sums on the device: fixed (fixed point, two 32-bit words), fixed32 (one
        /// word), fixed64 (one 64-bit word), packed64 (two sums in one 64-bit word), float (f32, by
        /// atomic add) or cas (f32, by compare and exchange) [default: fixed]
        #[cfg_attr(feature = "cli", arg(long, value_name = "NAME", hide_short_help = true))]
        pub accumulator: Option<Accumulator>,
        /// How the device draws splats, with the same bits in the image: scatter (one by one), tile
        /// (by tiles of the image) or auto (chosen by splat size and adapter) [default: auto]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", hide_short_help = true))]
        pub organisation: Option<Organisation>,
        /// How tiles get splats, with the same bits in the image: shared (eight invocations a tile
        /// exchange them), alone (each of them fetches its own) or staged (an invocation a pixel,
        /// from workgroup memory) [default: by the adapter]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", hide_short_help = true))]
        pub fetch: Option<Fetch>,
        /// Number of pixels, 0 to 4096, above which the bounds of a splat make it large: drawn by
        /// tiles, or with scatter by a workgroup; the bits of the image are the same [default: 256
        /// for tiles (0 with --organisation tile), 1024 for workgroups]
        #[cfg_attr(feature = "cli", arg(long, value_name = "PIXELS", hide_short_help = true))]
        pub large: Option<u32>,
        /// Optimisations to turn off, none of which changes a bit of the picture: culling, order,
        /// hiding, copies, pairs, long-words, gathering, sharing, splitting, uncounted-loops or
        /// division
        #[cfg_attr(feature = "cli", arg(long, value_name = "NAMES", value_delimiter = ',', hide_short_help = true))]
        pub without: Vec<Optimisation>,
        /// A WGSL file that replaces a built-in one: FILE=PATH, such as
        /// kernel_ellipse.wgsl=mine.wgsl
        ///
        /// A blending kernel is also evaluated in f64 for the reference. Its weights that are NaN,
        /// infinite, negative or above 1 are counted
        #[cfg_attr(feature = "cli", arg(long = "source", value_name = "FILE=PATH", hide_short_help = true))]
        pub sources: Vec<Replacement>,
        /// Format of the sums of --backend raster: rgba8unorm, rgba16float or rgba32float [default:
        /// rgba16float]
        #[cfg_attr(feature = "cli", arg(long, value_name = "FORMAT", hide_short_help = true))]
        pub blend_format: Option<BlendFormat>,
        /// Depth test of --backend raster: exact (in the shader) or offset (by the rasteriser)
        /// [default: exact]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", hide_short_help = true))]
        pub raster_depth: Option<RasterDepth>,
        /// Where shading is computed: pixel (with its blended normal) or splat (at its centre; the
        /// lit colours are blended) [default: pixel]
        #[cfg_attr(feature = "cli", arg(long, value_name = "WHAT", hide_short_help = true))]
        pub shading_at: Option<ShadingAt>,
        /// Draw each disk as an inscribed polygon of N sides, 3 to 16
        #[cfg_attr(feature = "cli", arg(long, value_name = "N", hide_short_help = true))]
        pub outline: Option<Outline>,
        /// Size of a node that --lod compares: extent (the image of its bounding sphere), area
        /// (the image of its ellipse, as in Pajarola 2003) or square (the square over the longer
        /// axis of that image) [default: extent]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", requires = "cut", hide_short_help = true))]
        pub lod_measure: Option<DetailMeasure>,
        /// Shape that nodes are drawn as: cap (curved like the surface below them) or disk (flat)
        /// [default: cap]
        #[cfg_attr(feature = "cli", arg(long, value_name = "SHAPE", requires = "cut", hide_short_help = true))]
        pub lod_shape: Option<NodeShape>,
    }
}
