//! Maps beside the colour.

use super::group::group;
use crate::scene::Map;

group! {
    /// Maps beside the colour.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Output"))]
    pub struct MapOptions {
        /// Maps beside the colour, in an EXR: depth, normal, weight, count, index, ...
        ///
        /// index names the input and the point that show most, transmittance the light that all
        /// surfaces of a pixel let through, layers their number, tail the share behind --composite
        /// layers:L, surfaces depth and alpha of the nearest eight, texz the place in a texture,
        /// and decision, of the reference, the distance to the nearest yes-or-no
        #[cfg_attr(feature = "cli", arg(long, value_name = "MAPS", value_delimiter = ','))]
        pub aov: Vec<Map>,
    }
}
