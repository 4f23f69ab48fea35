//! The surfaces that show behind a pixel's nearest one.

use super::group::group;
use crate::scene::{Composite, Tail};

group! {
    /// The surfaces that show behind a pixel's nearest one.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Transparency"))]
    pub struct TransparencyOptions {
        /// How surfaces behind the nearest one show: opaque, layers[:L], sorted, gaussians, ...
        ///
        /// opaque hides them. layers composites all surfaces from front to back, each with its own
        /// alpha; layers:L composites the nearest L. sorted composites all fragments in order of
        /// depth, each with its alpha times its weight. gaussians does the same by the rules of 2D
        /// Gaussian splatting. weighted and moments, for comparison, come near the result of
        /// sorted by sums that need no order; they shade splats instead of pixels [default:
        /// opaque; gaussians for Gaussians]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW"))]
        pub composite: Option<Composite>,
        /// Factor on all alphas, 0 to 1 [default: 1]
        #[cfg_attr(feature = "cli", arg(long, value_name = "A"))]
        pub opacity: Option<f32>,
        /// Surfaces behind the last of layers:L: sum (blended into one more) or none (left out)
        /// [default: sum]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", requires = "composite", hide_short_help = true))]
        pub tail: Option<Tail>,
    }
}
