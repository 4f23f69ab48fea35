//! Which fragments are one surface, and how they blend.

use super::group::group;
use crate::scene::{Blend, Cull, Epsilon, Join, Kernel, LowPass};

group! {
    /// Which fragments are one surface, and how they blend.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Surface"))]
    pub struct SurfaceOptions {
        /// Depth tolerance within which fragments are one surface: rel:E, abs:E, ray:E or radius:K
        ///
        /// rel:E is a fraction of the depth. abs:E is in world units along the camera's axis, ray:E
        /// in world units along the view ray. radius:K is a multiple of the surfel's shorter
        /// half-axis. radius:K,rel:E takes the smaller of the two [default: radius:1,rel:0.01]
        #[cfg_attr(feature = "cli", arg(long))]
        pub epsilon: Option<Epsilon>,
        /// Weight of a fragment by its distance rho from the disk's centre, 0 to 1:
        /// ellipse:A,N[,smooth] (exp(-A rho^N)), gaussian[:SIGMA], plateau:MID,SLOPE (the ellipse
        /// kernel with weight 1/2 and slope SLOPE at rho = MID), cone:P ((1-rho)^P), hat (cone:1)
        /// or constant [default: ellipse:6,3]
        #[cfg_attr(feature = "cli", arg(long, hide_short_help = true))]
        pub kernel: Option<Kernel>,
        /// Colour of a pixel: weighted (the mean of the fragments within epsilon of the nearest) or
        /// nearest (the nearest fragment alone, as with a depth test; unlit) [default: weighted]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", hide_short_help = true))]
        pub blend: Option<Blend>,
        /// Filter for splats about as small as a pixel: none (a disk covers a pixel only if it
        /// contains the pixel's centre), max (every splat covers a pixel; gaps between splats
        /// stay), ewa (splats are convolved with the pixel, which avoids aliasing) or gaussians
        /// (the filter of 2D Gaussian splatting) [default: none; gaussians for Gaussians]
        #[cfg_attr(feature = "cli", arg(long, value_name = "FILTER", hide_short_help = true))]
        pub lowpass: Option<LowPass>,
        /// Surfels to leave out: auto (those that face away, if a closed mesh hides them), back
        /// (all that face away), cones (nodes of --lod below which all face away, by their cones
        /// of normals alone) or none [default: auto]
        #[cfg_attr(feature = "cli", arg(long, value_name = "SIDE", hide_short_help = true))]
        pub cull: Option<Cull>,
        /// Do not blend surfels of different files: each pixel shows the surface of the nearest
        /// file
        #[cfg_attr(feature = "cli", arg(long))]
        pub separate: bool,
        /// Surface that shows where surfels meet triangles: corrected (the nearer one, by the
        /// surfels' blended depth), nearest (the nearer one, by the depth of the surfels' nearest
        /// fragment) or blended (both, if their depths differ by at most epsilon) [default:
        /// corrected]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", hide_short_help = true))]
        pub join: Option<Join>,
    }
}
