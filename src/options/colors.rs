//! Colours by an attribute of the points.

use super::group::group;
use super::values::ValueRange;
use crate::io::ColorBy;
use crate::scene::ColorMap;

group! {
    /// Colours by an attribute of the points.
    #[cfg_attr(feature = "cli", command(next_help_heading = "Look"))]
    pub struct ColorOptions {
        /// Colour points by z, intensity, class, return, gps-time, scan-angle, density, normal, rgb
        /// or any attribute that `epsplat info` lists
        ///
        /// class and return have a colour for each number, unless --color-map or --range is given.
        /// density is the number of points per square unit of the file, from the distance to the
        /// eighth neighbour. normal shows x, y and z from -1 to 1 as red, green and blue. The
        /// picture is unlit unless --shading is given, so that its colours are those of the legend
        #[cfg_attr(feature = "cli", arg(long, value_name = "ATTRIBUTE"))]
        pub color_by: Option<ColorBy>,
        /// Colours of --color-by: viridis, turbo, gray, inferno, magma, plasma, cividis, ...
        /// [default: viridis]
        ///
        /// Others are cubehelix, warm, cool, rainbow, sinebow, spectral, blues, greens, reds,
        /// and red-blue. A map with -r at its end runs the other way
        #[cfg_attr(feature = "cli", arg(long, value_name = "MAP", requires = "color_by"))]
        pub color_map: Option<ColorMap>,
        /// Values of --color-by at the ends of the colours, as numbers or percentiles [default:
        /// 2%,98%]
        ///
        /// Values beyond are clamped. Percentiles are those of all inputs together; for files that
        /// are read in part, those of their coarsest nodes
        #[cfg_attr(feature = "cli", arg(long, value_name = "LOW,HIGH", requires = "color_by", allow_hyphen_values = true))]
        pub range: Option<ValueRange>,
    }
}

impl ColorOptions {
    /// Whether points have other colours than those of their file.
    pub(crate) fn is_given(&self) -> bool {
        self.color_by.as_ref().is_some_and(|by| *by != ColorBy::Rgb)
    }

    /// Returns the name of the attribute that a reader has to store.
    pub(crate) fn column(&self) -> Option<String> {
        match &self.color_by {
            Some(ColorBy::Attribute(name)) => Some(name.clone()),
            _ => None,
        }
    }
}
