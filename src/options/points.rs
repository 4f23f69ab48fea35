//! Points as shapes that face the camera.

use super::group::group;
use super::values::Diameters;
use crate::scene::{PointShape, PointSize};

group! {
    /// Points as shapes that face the camera.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Points"))]
    pub struct PointOptions {
        /// Draw points as shapes that face the camera: square, circle, sphere, cone or paraboloid
        ///
        /// No normals are estimated and no neighbours are searched
        #[cfg_attr(feature = "cli", arg(long, value_name = "SHAPE"))]
        pub facing: Option<PointShape>,
        /// Size of points with --facing: radius:F, abs:R or pixels:D [default: radius:1]
        ///
        /// radius:F is a multiple of each point's own radius; points without radii share one radius
        /// that follows from their spacing. abs:R is a radius in world units, and pixels:D is a
        /// diameter in the image
        #[cfg_attr(feature = "cli", arg(long, value_name = "SIZE", requires = "facing"))]
        pub point_size: Option<PointSize>,
        /// Smallest and largest diameter of points with --facing, in pixels [default: 1,50]
        #[cfg_attr(feature = "cli", arg(long, value_name = "MIN,MAX", requires = "facing", hide_short_help = true))]
        pub pixels: Option<Diameters>,
    }
}
