//! Reading of textures from image files.

use std::path::Path;

use ::image::DynamicImage;

use super::image;
use crate::error::{Error, Result};
pub use crate::scene::Texture;

/// Bytes a pixel: 4 for the decoded image, and 4 for the texels, which may be a copy.
const COPIED: u64 = 4 + 4;

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
        Self::of_picture(path, image::decode(path, None, COPIED)?)
    }

    /// Reads an image from `bytes` in a file at `path`, as [`Self::read`] does.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    #[cfg(feature = "gltf")]
    pub(super) fn decoded(path: &Path, bytes: &[u8]) -> Result<Self> {
        Self::of_picture(path, image::decode_bytes(path, bytes, COPIED)?)
    }

    fn of_picture(path: &Path, picture: DynamicImage) -> Result<Self> {
        let picture = picture.into_rgba8();
        let (width, height) = (picture.width(), picture.height());
        // Reuses the allocation if its capacity is a multiple of a texel's size.
        let texels = bytemuck::allocation::try_cast_vec(picture.into_raw());
        let texels = texels.unwrap_or_else(|(_, bytes)| bytes.as_chunks().0.to_vec());
        Self::new(width, height, texels).ok_or_else(|| Error::malformed(path, "the image has no pixels"))
    }
}
