//! Views on a circle around the scene.

use std::num::NonZeroU32;

use super::{Renderer, View};
use crate::error::{Error, Result};
use crate::options::CameraOptions;
use crate::options::values::Ortho;
use crate::scene::Camera;

impl Renderer {
    /// Returns `count` views on a circle around the scene, the first as `options` frame it and the
    /// others counter-clockwise, seen from above.
    ///
    /// # Errors
    ///
    /// [`Error::Usage`] for options that place the camera, or that give no camera, and if this
    /// renderer has a share of the scene.
    pub fn turntable(&self, options: &CameraOptions, count: NonZeroU32) -> Result<Vec<View>> {
        if options.file.is_some() || options.eye.is_some() || options.intrinsics.is_some() {
            return Err(Error::Usage("a turntable frames the scene: leave eye, intrinsics and camera file out".into()));
        }
        if options.ortho == Some(Ortho::Fit) {
            return Err(Error::Usage("a turntable has one scale: give --ortho its HEIGHT".into()));
        }
        self.check_whole()?;
        // Checks size, lens and near depth.
        View::new(options)?;
        let scene = self.scene();
        let near = options.near.unwrap_or_else(|| self.extent.near(scene));
        let (size, (lens, _)) = (options.size.unwrap_or(View::DEFAULT_SIZE), options.lens());
        let cameras = Camera::turntable(size, lens, scene, near, (options.side()?, options.up), count)?;
        Ok(cameras.into_iter().map(View::from).collect())
    }
}
