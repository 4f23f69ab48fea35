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
        /// A node that looks smaller than SIZE is drawn in place of the surfels below it. SIZE is
        /// an area in square pixels (16px), a share of the image (0.01%) or a number as for
        /// --splats (100000splats); 0 draws all surfels. If the input has no levels, they are built
        /// first; `epsplat lod` stores them in a file. Only the needed part is read from COPC
        /// files, and from files of `epsplat lod` with 500,000 surfels or more
        #[cfg_attr(feature = "cli", arg(long, value_name = "SIZE", group = "cut"))]
        pub lod: Option<Detail>,
        /// Draw at most N surfels and nodes, with the finest --lod that allows it in each view
        ///
        /// More are drawn, with a note, where that is unavoidable: surfels that reach the camera's
        /// plane are always drawn, and nodes at the outline of a closed mesh are divided whatever
        /// their size. COPC files are read in whole nodes, at least the root
        #[cfg_attr(feature = "cli", arg(long, value_name = "N", group = "cut"))]
        pub splats: Option<NonZeroU64>,
        /// Fade coarser and finer levels into each other from view to view: on or off [default: on
        /// with --cameras, else off; COPC files never fade]
        #[cfg_attr(feature = "cli", arg(long, value_name = "on|off", requires = "cut", hide_short_help = true))]
        pub lod_fade: Option<Switch>,
    }
}
