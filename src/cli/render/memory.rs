//! `epsplat render --memory`: what host and device may take together.

use epsplat::plan::RenderOptions as Settings;
use epsplat::scene::{Camera, Composite};
use epsplat::surfels::part::Taken;
use epsplat::{Error, Result};

use super::views::pixel_bytes;

/// The largest buffer that a device may have where memory is bounded, bytes: that of the smallest devices. Images are rendered in bands that fit.
pub(super) const BUFFER: u64 = 128 << 20;

/// Memory of the program, its driver and a band, bytes: at most 280 MB were seen on llvmpipe, for images of 64x64 to 1024x1024 and 1 to 16 samples.
const PROGRAM: u64 = 320 << 20;

/// The same of lists of fragments, which are three buffers.
const LISTS: u64 = 3 * BUFFER;

/// The same of each node and surfel that is read: in the host's scene and the device's tree, in the cut, and as a splat. At most 330 were seen, where nearly all
/// of them are drawn, before rows of nodes had their centres, 24 bytes of host and device.
const RECORD: u64 = 400;

/// A bound for a picture, bytes.
pub(super) struct Memory {
    most: u64,
    /// What is taken whatever is read.
    fixed: u64,
}

impl Memory {
    /// That of the picture of `camera` with `settings`, of which there may be so many frames at once.
    ///
    /// # Errors
    /// [`Error::Usage`] for a bound that is reached before anything is read.
    pub fn of(most: u64, camera: &Camera, settings: &Settings, frames: u64) -> Result<Self> {
        let pixels = u64::from(camera.width) * u64::from(camera.height);
        let lists = if settings.composite == Composite::Opaque { 0 } else { LISTS };
        let fixed = PROGRAM + lists + pixels * pixel_bytes(settings.maps) * frames;
        if fixed <= most {
            return Ok(Self { most, fixed });
        }
        Err(Error::Usage(format!(
            "--memory {} is less than the {} that such a picture takes before anything is read: give more, or take a smaller --size",
            size(most),
            size(fixed)
        )))
    }

    /// Whether so much of a file fits.
    ///
    /// # Errors
    /// [`Error::Usage`] if not.
    pub fn fits(&self, taken: &Taken) -> Result<()> {
        let Taken { nodes, surfels, .. } = taken;
        if self.fixed + RECORD * (nodes + surfels) <= self.most {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "the view takes more than --memory {}, {nodes} nodes and {surfels} surfels at least: take --lod of a larger size",
            size(self.most)
        )))
    }
}

fn size(bytes: u64) -> String {
    format!("{:.2}GiB", bytes as f64 / 2f64.powi(30))
}
