//! The surfaces that show behind a pixel's nearest one.

use super::group::group;
use crate::scene::{Composite, Tail};

group! {
    /// The surfaces that show behind a pixel's nearest one.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Transparency"))]
    pub struct TransparencyOptions {
        /// Surfaces behind the nearest one: opaque, layers[:L], sorted, gaussians, ...
        ///
        /// opaque hides them; layers shows all, front to back, by the alpha of each, and layers:L
        /// the nearest L; sorted shows every fragment by its depth, with its alpha times its
        /// weight; gaussians does so by the rules of 2D Gaussian splatting. weighted and moments
        /// approximate sorted by sums in any order, to compare with; they light splats [default:
        /// opaque, of Gaussians gaussians]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW"))]
        pub composite: Option<Composite>,
        /// Factor of all alphas, 0 to 1 [default: 1]
        #[cfg_attr(feature = "cli", arg(long, value_name = "A"))]
        pub opacity: Option<f32>,
        /// Surfaces behind the last of layers:L: sum (blended as one more) or none [default: sum]
        #[cfg_attr(feature = "cli", arg(long, value_name = "HOW", requires = "composite", hide_short_help = true))]
        pub tail: Option<Tail>,
    }
}
