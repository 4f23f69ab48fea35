//! The limit of `--memory` on host and device memory together.

use crate::error::{Error, Result};
use crate::frame::pixel_bytes;
use crate::plan::Settings;
use crate::scene::{Camera, Composite};
use crate::surfels::part::Taken;

/// Largest buffer when memory is limited, bytes: what the smallest devices allow. Images are
/// rendered in bands that fit.
pub(super) const BUFFER: u64 = 128 << 20;

/// Memory of the program, its driver and a band, bytes.
///
/// At most 280 MB were measured on llvmpipe, for images of 64x64 to 1024x1024 and 1 to 16 samples.
const PROGRAM: u64 = 320 << 20;

/// Memory of the fragment lists of transparent pictures, bytes: three buffers.
const LISTS: u64 = 3 * BUFFER;

/// Memory per node or surfel that is read, bytes. It covers the host's scene, the device's tree,
/// the cut and the splat.
///
/// At most 330 bytes were measured, with nearly all nodes and surfels drawn. Since then each node
/// also stores its centre, which takes 24 bytes more on host and device.
const RECORD: u64 = 400;

/// The memory limit of a picture, bytes.
pub(super) struct Memory {
    most: u64,
    /// Memory used regardless of how many nodes and surfels are read.
    fixed: u64,
}

impl Memory {
    /// Returns the limit of `most` bytes for the picture of `camera` with `settings`.
    ///
    /// `frames` is the number of frames in memory at once.
    ///
    /// # Errors
    /// [`Error::Usage`] if the limit is exceeded before anything is read.
    pub fn of(most: u64, camera: &Camera, settings: &Settings, frames: u64) -> Result<Self> {
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        let lists = if settings.composite == Composite::Opaque { 0 } else { LISTS };
        let fixed = PROGRAM + lists + pixels * pixel_bytes(settings.maps) * frames;
        if fixed <= most {
            return Ok(Self { most, fixed });
        }
        Err(Error::Usage(format!(
            "--memory {} is less than the {} that such a picture needs before anything is read: give more, or a smaller --size",
            size(most),
            size(fixed)
        )))
    }

    /// Checks that the `taken` nodes and surfels fit into the limit.
    ///
    /// # Errors
    /// [`Error::Usage`] if they do not.
    pub fn fits(&self, taken: &Taken) -> Result<()> {
        let Taken { nodes, surfels, .. } = taken;
        if self.fixed + RECORD * (nodes + surfels) <= self.most {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "the view needs more than --memory {}, as it has at least {nodes} nodes and {surfels} surfels: give --lod a larger size",
            size(self.most)
        )))
    }
}

fn size(bytes: u64) -> String {
    format!("{:.2}GiB", bytes as f64 / 2f64.powi(30))
}
