//! The cameras of `--cameras`.

use std::path::Path;

use clap::Args;
use epsplat::io::cameras::{self, NamedCamera};
use epsplat::options::parse::scale;
use epsplat::{Error, Result, View};

use super::note;

/// How the lenses of many cameras are used.
#[derive(Args)]
#[command(next_help_heading = "Camera")]
pub(super) struct LensArguments {
    /// Factor of the width and height of --cameras' images; intrinsics are scaled too
    #[arg(long, value_name = "FACTOR", value_parser = scale, requires = "cameras", hide_short_help = true)]
    pub(super) scale: Option<f64>,
    /// Ignore the lens distortion of --cameras; by default a distorted camera is an error
    #[arg(long, requires = "cameras", hide_short_help = true)]
    pub(super) ignore_distortion: bool,
}

impl LensArguments {
    /// Reads the cameras at `path`. Those without a size get `size`, or else the default.
    ///
    /// # Errors
    ///
    /// [`Error::Malformed`] if a lens is distorted, unless `--ignore-distortion` is given, and
    /// errors of reading.
    pub(super) fn read(&self, path: &Path, size: Option<(u32, u32)>) -> Result<Vec<NamedCamera>> {
        let cameras = cameras::read(path, size.unwrap_or(View::DEFAULT_SIZE))?;
        let distorted = cameras.iter().filter(|camera| camera.distortion.is_some());
        let first = distorted.clone().find_map(|camera| Some((&camera.name, camera.distortion?)));
        if let Some((first, distortion)) = first {
            if !self.ignore_distortion {
                return Err(Error::malformed(
                    path,
                    format!(
                        "the lens of {first} is distorted ({distortion}), which is not rendered: undistort the pictures, or \
                         give --ignore-distortion"
                    ),
                ));
            }
            note(&format!("the lens distortion of {} cameras is left out", distorted.count()));
        }
        Ok(cameras)
    }
}
