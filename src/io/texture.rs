//! Textures from files.

use std::path::Path;

use super::image;
use crate::error::{Error, Result};
pub use crate::scene::Texture;

impl Texture {
    /// Reads a PNG or JPEG file, whatever its name ends in; of 16-bit values the upper byte counts.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] where the system cannot read or has no memory for it, [`Error::Malformed`] for what is neither or has
    /// more than [`MOST_PIXELS`](image::MOST_PIXELS).
    pub fn read(path: &Path) -> Result<Self> {
        // Four bytes, and then the texel.
        let picture = image::decode(path, None, 4 + 4)?.into_rgba8();
        let texels = picture.pixels().map(|pixel| pixel.0).collect();
        let texture = Self::new(picture.width(), picture.height(), texels);
        texture.ok_or_else(|| Error::malformed(path, "the image has no pixels"))
    }
}
