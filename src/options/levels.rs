//! Levels of detail: how coarse a picture may be.

use std::num::NonZeroU64;

use super::group::group;
use super::values::Switch;
use crate::scene::Detail;

group! {
    /// Levels of detail: how coarse a picture may be.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Levels of detail"))]
    pub struct LevelOptions {
        /// Draw coarser levels of detail where nodes are smaller than this: 16px or 0.01%
        ///
        /// A node that is seen smaller is drawn in place of the surfels below it. The size is in
        /// square pixels, 16px, or a share of the image, 0.01%; 0 draws all surfels. Levels that
        /// the input lacks are made first; `epsplat lod` keeps them in a file. Of COPC files, and
        /// of files of `epsplat lod` with 500,000 surfels or more, only the needed part is read
        #[cfg_attr(feature = "cli", arg(long, value_name = "SIZE", group = "cut"))]
        pub lod: Option<Detail>,
        /// Draw at most N surfels and nodes, by the --lod that each view needs
        ///
        /// Surfels that reach the camera's plane are always drawn, and nodes at the outline of a
        /// closed mesh are divided at any size; the picture's note says so. Of COPC files whole
        /// nodes are read, the root at least
        #[cfg_attr(feature = "cli", arg(long, value_name = "N", group = "cut"))]
        pub splats: Option<NonZeroU64>,
        /// Fade coarser and finer cuts into each other from view to view: on or off
        /// [default: on with --cameras, else off; never of COPC files]
        #[cfg_attr(feature = "cli", arg(long, value_name = "on|off", requires = "cut", hide_short_help = true))]
        pub lod_fade: Option<Switch>,
    }
}
