//! PNG: 8-bit sRGB with straight alpha.

use std::path::Path;

use ::image::{ExtendedColorType, ImageEncoder, ImageFormat, ImageResult, codecs};

use super::atomic::write_whole;
use super::{Texture, image};
use crate::error::Result;
use crate::frame::Frame;
use crate::scene::color::{srgb_to_linear, srgb8};
use rayon::prelude::*;

/// Writes the colour of a frame, clamped to [0, 1].
pub fn write(path: &Path, frame: &Frame) -> Result<()> {
    let bytes = srgb_bytes(&frame.color);
    write_whole(path, |file| encode(file, frame.width, frame.height, &bytes).map_err(std::io::Error::other))
}

/// Writes the 8-bit codes of a texture.
///
/// # Errors
///
/// [`Error::Write`](crate::Error::Write) where the system cannot write.
pub fn write_texture(path: &Path, texture: &Texture) -> Result<()> {
    let [width, height] = texture.size();
    let bytes = texture.texels().as_flattened();
    write_whole(path, |file| encode(file, width, height, bytes).map_err(std::io::Error::other))
}

/// Converts linear colours to sRGB codes, four bytes each.
pub(crate) fn srgb_bytes(color: &[[f32; 4]]) -> Vec<u8> {
    color.par_iter().copied().map(srgb8).collect::<Vec<_>>().into_flattened()
}

/// Encodes a PNG from four bytes a pixel.
pub(crate) fn encode(out: impl std::io::Write, width: u32, height: u32, rgba: &[u8]) -> ImageResult<()> {
    codecs::png::PngEncoder::new(out).write_image(rgba, width, height, ExtendedColorType::Rgba8)
}

/// Reads a PNG as linear light.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) where the system cannot read or lacks memory,
/// [`Error::Malformed`](crate::Error::Malformed) for a file that is not PNG or has more than
/// [`MOST_PIXELS`](super::image::MOST_PIXELS).
pub fn read(path: &Path) -> Result<Frame> {
    // 8 bytes a pixel for the 16-bit codes, and 16 for the frame's colour.
    let picture = image::decode(path, Some(ImageFormat::Png), 8 + 16)?.into_rgba16();
    let color = picture.pixels().map(|pixel| {
        let [r, g, b, a] = pixel.0.map(|v| f64::from(v) / 65535.0);
        [srgb_to_linear(r) as f32, srgb_to_linear(g) as f32, srgb_to_linear(b) as f32, a as f32]
    });
    Ok(Frame::of_colors(picture.width(), picture.height(), color.collect()))
}
