//! Which fragments are one surface, and how they blend.

use super::group::group;
use crate::scene::{Blend, Cull, Epsilon, Join, Kernel, LowPass};

group! {
    /// Which fragments are one surface, and how they blend.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Surface"))]
    pub struct SurfaceOptions {
        /// Depth within which fragments are one surface: rel:E, abs:E, ray:E, radius:K
        ///
        /// rel:E is a fraction of the depth, abs:E world units along the camera's axis, ray:E world
        /// units along the view ray, radius:K a multiple of the surfel's shorter half-axis and
        /// radius:K,rel:E the lesser of both [default: radius:1,rel:0.01]
        #[cfg_attr(feature = "cli", arg(long))]
        pub epsilon: Option<Epsilon>,
        /// Weight of a fragment by its distance rho from the disk's centre, 0 to 1:
        /// ellipse:A,N[,smooth] (exp(-A rho^N)), gaussian[:SIGMA], plateau:MID,SLOPE (the ellipse
        /// that is 1/2 at MID with that slope), cone:P ((1-rho)^P), hat (cone:1) or constant
        /// [default: ellipse:6,3]
        #[cfg_attr(feature = "cli", arg(long, hide_short_help = true))]
        pub kernel: Option<Kernel>,
        /// Colour of a pixel: weighted (the mean of the fragments within epsilon of the nearest) or
        /// nearest (the nearest fragment alone, as with a depth test; unlit) [default: weighted]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", hide_short_help = true))]
        pub blend: Option<Blend>,
        /// Filter for splats near a pixel in size: none (a pixel's centre lies in a disk or not),
        /// max (every splat reaches a pixel; gaps between splats stay), ewa (splats are convolved
        /// with the pixel; no aliasing) or gaussians (as 2D Gaussian splatting does it) [default:
        /// none, of Gaussians gaussians]
        #[cfg_attr(feature = "cli", arg(long, value_name = "FILTER", hide_short_help = true))]
        pub lowpass: Option<LowPass>,
        /// Surfels that are left out: auto (those that face away, where a closed mesh hides them),
        /// back (all that face away) or none [default: auto]
        #[cfg_attr(feature = "cli", arg(long, value_name = "SIDE", hide_short_help = true))]
        pub cull: Option<Cull>,
        /// Keep the inputs apart: surfels of different files do not blend; the nearer one shows
        #[cfg_attr(feature = "cli", arg(long))]
        pub separate: bool,
        /// Where surfels meet triangles: corrected (the nearer one shows, surfels by their blended
        /// depth), nearest (the nearer one, surfels by their nearest fragment) or blended (both,
        /// within epsilon) [default: corrected]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", hide_short_help = true))]
        pub join: Option<Join>,
    }
}
