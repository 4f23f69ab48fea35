//! Reading of textures from image files.

use std::path::Path;

use super::image;
use crate::error::{Error, Result};
pub use crate::scene::Texture;

impl Texture {
    /// Reads a PNG, JPEG, BMP or TGA file. 16-bit values are reduced to their upper byte.
    ///
    /// The first bytes decide the format, whatever the file is called. TGA has no signature, so the
    /// file's extension decides for TGA.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] where the system cannot read or lacks memory, or for a device or a pipe.
    /// [`Error::Malformed`] for a file of another format, or with more than
    /// [`MOST_PIXELS`](image::MOST_PIXELS).
    pub fn read(path: &Path) -> Result<Self> {
        image::check_file(path)?;
        // 4 bytes a pixel for the decoded image, and 4 for the texels, which may be a copy.
        let picture = image::decode(path, None, 4 + 4)?.into_rgba8();
        let (width, height) = (picture.width(), picture.height());
        // Reuses the allocation if its capacity is a multiple of a texel's size.
        let texels = bytemuck::allocation::try_cast_vec(picture.into_raw());
        let texels = texels.unwrap_or_else(|(_, bytes)| bytes.as_chunks().0.to_vec());
        Self::new(width, height, texels).ok_or_else(|| Error::malformed(path, "the image has no pixels"))
    }
}
