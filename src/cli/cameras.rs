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
    /// Ignore the lens distortion of --cameras and render pinholes with the same focal lengths
    #[arg(long, requires = "cameras", hide_short_help = true)]
    pub(super) ignore_distortion: bool,
}

impl LensArguments {
    /// Reads the cameras at `path`. Those without a size get `size`, or else the default.
    ///
    /// # Errors
    ///
    /// [`Error::Malformed`] if a lens is of a model that is not rendered, unless
    /// `--ignore-distortion` is given, and errors of reading.
    pub(super) fn read(&self, path: &Path, size: Option<(u32, u32)>) -> Result<Vec<NamedCamera>> {
        let mut cameras = cameras::read(path, size.unwrap_or(View::DEFAULT_SIZE))?;
        if !self.ignore_distortion {
            let undrawn = cameras.iter().find_map(|camera| Some((&camera.name, camera.undrawn?)));
            return match undrawn {
                Some((name, model)) => Err(Error::malformed(
                    path,
                    format!(
                        "the lens of {name}, of the model {model}, is not rendered: undistort the pictures, or give \
                         --ignore-distortion"
                    ),
                )),
                None => Ok(cameras),
            };
        }
        let mut ignored = 0;
        for named in &mut cameras {
            let pinhole = named.camera.as_pinhole();
            ignored += u32::from(pinhole.is_some() || named.undrawn.is_some());
            named.camera = pinhole.unwrap_or_else(|| named.camera.clone());
        }
        if ignored > 0 {
            note(&format!("the lens distortion of {ignored} cameras is left out"));
        }
        Ok(cameras)
    }
}
