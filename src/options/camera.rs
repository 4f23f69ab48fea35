//! The view of a picture.

use std::path::PathBuf;

use glam::DVec3;

use super::values::Ortho;
use crate::error::Result;
use crate::scene::lens::{DEFAULT_FISHEYE, DEFAULT_FOV};
use crate::scene::side::ELEVATION;
use crate::scene::{Form, Lens, Optics, Side};

/// The view of a picture. Without an eye or a camera file it shows the whole scene.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[cfg_attr(feature = "cli", command(next_help_heading = "Camera"))]
// Brackets in help texts hold defaults, not links.
#[allow(rustdoc::broken_intra_doc_links)]
pub struct CameraOptions {
    /// Image size in pixels, or one number for a square [default: 1024x1024, or the camera file's]
    #[cfg_attr(feature = "cli", arg(long, value_name = "WxH", value_parser = super::parse::size))]
    pub size: Option<(u32, u32)>,
    /// Position of the camera, world coordinates [default: a view of the whole scene]
    #[cfg_attr(feature = "cli", arg(long, value_name = "X,Y,Z", value_parser = super::parse::vector, allow_hyphen_values = true))]
    pub eye: Option<DVec3>,
    /// Side from which the whole scene is in view: front, back, left, right, top, bottom, iso,
    /// north, sw, ... or X,Y,Z
    ///
    /// front, back, left and right are level. Compass directions are those of maps (north is +y, or
    /// -z where y is up), seen from 30 degrees above the horizon. top has north at its top, and
    /// X,Y,Z points from the scene to the camera
    #[cfg_attr(
        feature = "cli",
        arg(long, visible_alias = "view", value_name = "SIDE", allow_hyphen_values = true, conflicts_with = "eye")
    )]
    pub from: Option<Side>,
    /// Compass direction from the scene to the camera, which has the whole scene in view: 0 for
    /// north, 90 for east, degrees [default: 180]
    #[cfg_attr(feature = "cli", arg(long, value_name = "DEGREES", allow_hyphen_values = true, conflicts_with_all = ["eye", "from"]))]
    pub azimuth: Option<f64>,
    /// Angle of the camera above the horizon, which has the whole scene in view: -90 to 90 degrees
    /// [default: 30]
    #[cfg_attr(feature = "cli", arg(long, value_name = "DEGREES", allow_hyphen_values = true, conflicts_with_all = ["eye", "from"]))]
    pub elevation: Option<f64>,
    /// Point that the camera looks at [default: the scene's centre]
    #[cfg_attr(feature = "cli", arg(long, value_name = "X,Y,Z", value_parser = super::parse::vector, allow_hyphen_values = true, requires = "eye"))]
    pub target: Option<DVec3>,
    /// World direction that is up in the image: x, y, z, -x, -y, -z or X,Y,Z [default: the file's]
    ///
    /// LAS files and PLY files written by epsplat define it. In other files it is z if the cloud is
    /// flat, else y
    #[cfg_attr(feature = "cli", arg(long, value_name = "AXIS|X,Y,Z", value_parser = super::parse::up, allow_hyphen_values = true))]
    pub up: Option<DVec3>,
    /// Vertical field of view in degrees; a fisheye's is horizontal [default: 45]
    #[cfg_attr(feature = "cli", arg(long, value_name = "DEGREES", conflicts_with_all = ["ortho", "intrinsics"]))]
    pub fov: Option<f64>,
    /// Projection: perspective, fisheye (equidistant; --fov is the angle across the width, 180 by
    /// default) or equirectangular (the whole sphere) [default: perspective]
    ///
    /// A fisheye and a sphere need --eye, and their depth is the distance from it. The size of a
    /// sphere's image is 2048x1024 by default
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME", conflicts_with = "ortho", hide_short_help = true))]
    pub projection: Option<Form>,
    /// Orthographic view; the image is HEIGHT world units high, or as high as the scene needs
    #[cfg_attr(feature = "cli", arg(long, value_name = "HEIGHT", num_args = 0..=1, default_missing_value = "fit", conflicts_with = "intrinsics"))]
    pub ortho: Option<Ortho>,
    /// Focal lengths and principal point in pixels
    #[cfg_attr(feature = "cli", arg(long, value_name = "FX,FY,CX,CY", value_parser = super::parse::intrinsics, allow_hyphen_values = true, hide_short_help = true))]
    pub intrinsics: Option<[f64; 4]>,
    /// Camera file (see the guide), in place of all other camera options except --size
    #[cfg_attr(feature = "cli", arg(long = "camera", value_name = "CAMERA.json", conflicts_with_all = ["eye", "from", "azimuth", "elevation", "target", "up", "fov", "projection", "ortho", "intrinsics"], hide_short_help = true))]
    pub file: Option<PathBuf>,
    /// Map from straight above with pixels of SIZE world units, north (+y) at the top
    ///
    /// The size of the image follows from the data or --bounds. The lines of its grid lie at
    /// multiples of SIZE, so that maps with one SIZE fit together. A .tif has the place of the map
    /// and the coordinate system of LAS files (GeoTIFF) and may be larger than memory; a .png or
    /// .jpg gets a world file (.pgw, .jgw). z is up: files whose up is y need --up z
    #[cfg_attr(feature = "cli", arg(long, value_name = "SIZE", value_parser = super::parse::scale, conflicts_with_all = ["size", "eye", "from", "azimuth", "elevation", "target", "fov", "projection", "ortho", "intrinsics", "file", "near"]))]
    pub pixel_size: Option<f64>,
    /// Part of a map of --pixel-size, extended to whole pixels [default: all data]
    #[cfg_attr(feature = "cli", arg(long, value_name = "XMIN,YMIN,XMAX,YMAX", value_parser = super::parse::bounds, allow_hyphen_values = true, requires = "pixel_size"))]
    pub bounds: Option<[f64; 4]>,
    /// Smallest depth drawn, world units [default: a millionth of the scene's extent]
    #[cfg_attr(feature = "cli", arg(long, value_name = "DEPTH", hide_short_help = true))]
    pub near: Option<f64>,
}

impl CameraOptions {
    /// Returns the side from which the options have the scene in view, if they say so.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::Error::Usage) for angles that give no direction.
    pub(crate) fn side(&self) -> Result<Option<Side>> {
        match (self.azimuth, self.elevation) {
            (None, None) => Ok(self.from),
            (azimuth, elevation) => Side::at(azimuth.unwrap_or(180.0), elevation.unwrap_or(ELEVATION)).map(Some),
        }
    }

    /// Returns the lens, and the name of the option that gives it.
    pub(crate) fn lens(&self) -> (Lens, &'static str) {
        match (self.projection, self.intrinsics) {
            (Some(Form::Fisheye), Some(values)) => {
                return (Lens::Curved(Optics::of(Form::Fisheye), values), "--intrinsics");
            }
            (Some(Form::Fisheye), None) => return (Lens::Fisheye(self.fov.unwrap_or(DEFAULT_FISHEYE)), "--fov"),
            (Some(Form::Equirectangular), _) => return (Lens::Equirectangular, "--projection"),
            (Some(Form::Perspective) | None, _) => {}
        }
        match (self.intrinsics, self.ortho) {
            (Some(values), _) => (Lens::Intrinsics(values), "--intrinsics"),
            (None, Some(Ortho::Height(height))) => (Lens::OrthographicHeight(height), "--ortho"),
            // The scene decides the height.
            (None, Some(Ortho::Fit)) => (Lens::OrthographicHeight(1.0), "--ortho"),
            (None, None) => (Lens::Fov(self.fov.unwrap_or(DEFAULT_FOV)), "--fov"),
        }
    }
}
