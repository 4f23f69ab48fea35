//! Marks on a finished picture.

use super::group::group;
use crate::annotate::Marks;

group! {
    /// Marks on a finished picture.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Look"))]
    pub struct MarkOptions {
        /// Draw a legend of the colours of --color-by into the picture
        ///
        /// It names the attribute, its unit if known, and values beside a bar of colours, or the
        /// classes that occur. Maps (--aov) stay as they are
        #[cfg_attr(feature = "cli", arg(long))]
        pub legend: bool,
        /// Draw a scale bar into an orthographic picture, in the units of the file
        #[cfg_attr(feature = "cli", arg(long))]
        pub scale_bar: bool,
        /// Draw an arrow to the north, +y of map coordinates, into an orthographic picture from
        /// above
        #[cfg_attr(feature = "cli", arg(long, hide_short_help = true))]
        pub north: bool,
    }
}

impl MarkOptions {
    /// Returns the marks to draw.
    pub(crate) fn marks(&self) -> Marks {
        let Self { legend, scale_bar, north } = *self;
        Marks { legend, scale_bar, north }
    }
}
