//! How points become surfels.

use std::path::PathBuf;

use crate::surfels::{Limits, Size};

/// Outliers, and the size and shape of estimated surfels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[cfg_attr(feature = "cli", command(next_help_heading = "Surfels from points"))]
// Brackets in help texts hold defaults, not links.
#[allow(rustdoc::broken_intra_doc_links)]
pub struct LimitOptions {
    /// Drop outliers: points farther from their neighbours than the mean plus K standard deviations
    ///
    /// A point's distance is its mean distance to 16 neighbours; mean and deviation are over all
    /// points
    #[cfg_attr(feature = "cli", arg(long, value_name = "K", hide_short_help = true))]
    pub outliers: Option<f64>,
    /// Largest estimated half-axis, as a multiple of the neighbours' median; inf for no limit
    /// [default: 3]
    #[cfg_attr(feature = "cli", arg(long, value_name = "FACTOR", hide_short_help = true))]
    pub max_radius: Option<f64>,
    /// Estimate flat disks instead of disks that curve with the surface: faster frames
    #[cfg_attr(feature = "cli", arg(long))]
    pub flat: bool,
}

impl LimitOptions {
    /// Returns the limits of the surfels to estimate.
    pub fn limits(&self) -> Limits {
        let largest_ratio = self.max_radius.unwrap_or(Limits::default().largest_ratio);
        Limits { outliers: self.outliers, largest_ratio, curved: !self.flat }
    }
}

/// How surfels are sized and painted.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[cfg_attr(feature = "cli", command(next_help_heading = "Surfels from points"))]
pub struct SurfelOptions {
    /// Outliers, and the size and shape of estimated surfels.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub limits: LimitOptions,
    /// Estimate sizes anew, as `epsplat surfels --size`: knn, ellipse, bsp, bsp:RULE or qsplat
    ///
    /// RULE is circumsphere, global or global-circumsphere
    #[cfg_attr(feature = "cli", arg(long = "surfel-size", id = "surfel_size", value_name = "HOW", conflicts_with_all = ["facing", "separate", "textures"], hide_short_help = true))]
    pub size: Option<Size>,
    /// Scale all surfels by this factor: smaller ones show where each lies, larger ones close holes
    #[cfg_attr(feature = "cli", arg(long, value_name = "FACTOR", hide_short_help = true))]
    pub radius_scale: Option<f64>,
    /// Image that paints the surfels by their texture coordinates: .png, .jpg, .bmp or .tga
    ///
    /// It replaces the surfels' own colours; `epsplat sample` writes texture coordinates. If the
    /// option is given several times, the images belong to the inputs in order. With one input they
    /// belong to the image numbers (texnumber) of its points
    #[cfg_attr(feature = "cli", arg(long = "texture", id = "textures", value_name = "IMAGE"))]
    pub textures: Vec<PathBuf>,
}
