//! Maps beside the colour.

use super::group::group;
use crate::scene::Map;

group! {
    /// Maps beside the colour.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Output"))]
    pub struct MapOptions {
        /// Maps to write beside the colour: depth, normal, height, weight, count, index, ...
        ///
        /// An .exr or .npz holds all of them; an .npy or .tif holds one in place of the colour.
        /// height is the coordinate along the scene's up axis (z in laser scans) of the surface at
        /// the depth. weight is the sum of the fragments' weights, and count is their number. index
        /// names the input and the point of the surfel with the greatest weight. transmittance is
        /// the share of light that passes all surfaces of a pixel, and layers is their number. tail
        /// is the share of the surfaces behind the last layer of --composite layers:L. surfaces
        /// holds depth and alpha of the nearest eight surfaces. texz holds texture coordinates and
        /// depth. decision, which only the reference makes, is the smallest relative distance of a
        /// fragment to a threshold, such as a disk's rim or epsilon
        #[cfg_attr(feature = "cli", arg(long, value_name = "MAPS", value_delimiter = ','))]
        pub aov: Vec<Map>,
    }
}
