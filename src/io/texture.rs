//! Textures from files.

use std::path::Path;

use image::ImageReader;

use crate::error::{Error, Result};
pub use crate::scene::Texture;

/// No texture has more pixels.
const LARGEST: u64 = 1 << 28;

impl Texture {
    /// Reads a PNG or JPEG file, whatever its name ends in; of 16-bit values the upper byte counts.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] where the system cannot read, [`Error::Malformed`] for what is neither or has more than 2^28 pixels.
    pub fn read(path: &Path) -> Result<Self> {
        let open = || ImageReader::open(path).and_then(ImageReader::with_guessed_format);
        let unreadable = |e: image::ImageError| Error::malformed(path, format!("not a readable PNG or JPEG: {e}"));
        let (width, height) = open().map_err(|e| Error::read(path, e))?.into_dimensions().map_err(unreadable)?;
        if u64::from(width) * u64::from(height) > LARGEST {
            return Err(Error::malformed(
                path,
                format!("a texture has at most {LARGEST} pixels, not {width}x{height}"),
            ));
        }
        let mut reader = open().map_err(|e| Error::read(path, e))?;
        reader.no_limits();
        let picture = reader.decode().map_err(unreadable)?.into_rgba8();
        let texels = picture.pixels().map(|pixel| pixel.0).collect();
        Self::new(width, height, texels).ok_or_else(|| Error::malformed(path, "the image has no pixels"))
    }
}
