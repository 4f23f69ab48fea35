//! Textures from files.

use std::path::Path;

use super::image;
use crate::error::{Error, Result};
pub use crate::scene::Texture;

impl Texture {
    /// Reads a PNG, JPEG, BMP or TGA file, whatever its name ends in, but for TGA, which nothing
    /// but its name tells; of 16-bit values the upper byte counts.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] where the system cannot read or has no memory for it, [`Error::Malformed`]
    /// for what is none of these, is no file but a device or a pipe, or has more than
    /// [`MOST_PIXELS`](image::MOST_PIXELS).
    pub fn read(path: &Path) -> Result<Self> {
        image::check_file(path)?;
        // Four bytes, which become the texel.
        let picture = image::decode(path, None, 4 + 4)?.into_rgba8();
        let (width, height) = (picture.width(), picture.height());
        // The same bytes, where the room for them allows it.
        let texels = bytemuck::allocation::try_cast_vec(picture.into_raw());
        let texels = texels.unwrap_or_else(|(_, bytes)| bytes.as_chunks().0.to_vec());
        Self::new(width, height, texels).ok_or_else(|| Error::malformed(path, "the image has no pixels"))
    }
}
