//! The view of a picture.

use std::path::PathBuf;

use glam::DVec3;

use crate::scene::camera::DEFAULT_FOV;
use crate::scene::{Lens, Side};

/// The view of a picture. Without an eye or a camera file it shows the whole scene.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[cfg_attr(feature = "cli", command(next_help_heading = "Camera"))]
// Brackets in help texts hold defaults, not links.
#[allow(rustdoc::broken_intra_doc_links)]
pub struct CameraOptions {
    /// Image size in pixels [default: 1024x1024, or the camera file's]
    #[cfg_attr(feature = "cli", arg(long, value_name = "WxH", value_parser = super::parse::size))]
    pub size: Option<(u32, u32)>,
    /// Position of the camera, world coordinates [default: a view of the whole scene]
    #[cfg_attr(feature = "cli", arg(long, value_name = "X,Y,Z", value_parser = super::parse::vector, allow_hyphen_values = true))]
    pub eye: Option<DVec3>,
    /// Side from which the whole scene is in view: north, east, south, west, above or X,Y,Z
    ///
    /// Compass directions are those of maps (north is +y, or -z where y is up), seen from 30
    /// degrees above the horizon. X,Y,Z points from the scene to the camera
    #[cfg_attr(feature = "cli", arg(long, value_name = "SIDE", allow_hyphen_values = true, conflicts_with = "eye"))]
    pub from: Option<Side>,
    /// Point that the camera looks at [default: the scene's centre]
    #[cfg_attr(feature = "cli", arg(long, value_name = "X,Y,Z", value_parser = super::parse::vector, allow_hyphen_values = true, requires = "eye"))]
    pub target: Option<DVec3>,
    /// World direction that is up in the image: x, y, z, -x, -y, -z or X,Y,Z [default: the file's]
    ///
    /// LAS files and PLY files written by epsplat define it. In other files it is z if the cloud is
    /// flat, else y
    #[cfg_attr(feature = "cli", arg(long, value_name = "AXIS|X,Y,Z", value_parser = super::parse::up, allow_hyphen_values = true))]
    pub up: Option<DVec3>,
    /// Vertical field of view in degrees [default: 45]
    #[cfg_attr(feature = "cli", arg(long, value_name = "DEGREES", conflicts_with_all = ["ortho", "intrinsics"]))]
    pub fov: Option<f64>,
    /// Orthographic view; the image is HEIGHT world units high
    #[cfg_attr(feature = "cli", arg(long, value_name = "HEIGHT", conflicts_with = "intrinsics"))]
    pub ortho: Option<f64>,
    /// Focal lengths and principal point in pixels
    #[cfg_attr(feature = "cli", arg(long, value_name = "FX,FY,CX,CY", value_parser = super::parse::intrinsics, allow_hyphen_values = true, hide_short_help = true))]
    pub intrinsics: Option<[f64; 4]>,
    /// Camera file (see the guide), in place of all other camera options except --size
    #[cfg_attr(feature = "cli", arg(long = "camera", value_name = "CAMERA.json", conflicts_with_all = ["eye", "from", "target", "up", "fov", "ortho", "intrinsics"], hide_short_help = true))]
    pub file: Option<PathBuf>,
    /// Map from straight above with pixels of SIZE world units, north (+y) at the top
    ///
    /// The size of the image follows from the data or --bounds. The lines of its grid lie at
    /// multiples of SIZE, so that maps with one SIZE fit together. A .tif has the place of the map
    /// and the coordinate system of LAS files (GeoTIFF) and may be larger than memory; a .png or
    /// .jpg gets a world file (.pgw, .jgw). z is up: files whose up is y need --up z
    #[cfg_attr(feature = "cli", arg(long, value_name = "SIZE", value_parser = super::parse::scale, conflicts_with_all = ["size", "eye", "from", "target", "fov", "ortho", "intrinsics", "file", "near"]))]
    pub pixel_size: Option<f64>,
    /// Part of a map of --pixel-size, extended to whole pixels [default: all data]
    #[cfg_attr(feature = "cli", arg(long, value_name = "XMIN,YMIN,XMAX,YMAX", value_parser = super::parse::bounds, allow_hyphen_values = true, requires = "pixel_size"))]
    pub bounds: Option<[f64; 4]>,
    /// Smallest depth drawn, world units [default: a millionth of the scene's extent]
    #[cfg_attr(feature = "cli", arg(long, value_name = "DEPTH", hide_short_help = true))]
    pub near: Option<f64>,
}

impl CameraOptions {
    /// Returns the lens, and the name of the option that gives it.
    pub(crate) fn lens(&self) -> (Lens, &'static str) {
        match (self.intrinsics, self.ortho) {
            (Some(values), _) => (Lens::Intrinsics(values), "--intrinsics"),
            (None, Some(height)) => (Lens::OrthographicHeight(height), "--ortho"),
            (None, None) => (Lens::Fov(self.fov.unwrap_or(DEFAULT_FOV)), "--fov"),
        }
    }
}
