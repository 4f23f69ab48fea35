//! Reading of images: one size limit for all, checked in the header before memory is allocated.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

use ::image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader};

use super::input::check_regular;
use crate::error::{Error, Result};

/// The most pixels of an image that is read: 16384x16384, a common size of scans' textures.
pub const MOST_PIXELS: u64 = 1 << 28;

/// Refuses an image of more than [`MOST_PIXELS`], or one for which the system lacks memory at
/// `each` bytes a pixel.
///
/// # Errors
///
/// [`Error::Malformed`] for too many pixels, [`Error::Read`] for too little memory.
pub(super) fn check(path: &Path, (width, height): (u64, u64), each: u64) -> Result<()> {
    let pixels = width.saturating_mul(height);
    if pixels > MOST_PIXELS {
        let what =
            format!("the image is {width}x{height}, more than the limit of {MOST_PIXELS} pixels: make it smaller");
        return Err(Error::malformed(path, what));
    }
    check_room(path, pixels.saturating_mul(each))
}

/// Checks that the system can allocate this many bytes for data from the file at `path`.
///
/// The memory is freed at once. The check matters because decoders allocate in parts and abort the
/// program when an allocation fails.
///
/// # Errors
///
/// [`Error::Read`] if the allocation fails.
pub fn check_room(path: &Path, bytes: u64) -> Result<()> {
    let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
    let room = Vec::<u8>::new().try_reserve_exact(bytes);
    room.map_err(|_| Error::read(path, std::io::ErrorKind::OutOfMemory.into()))
}

/// Checks that a file named by another one is a regular file: a pipe or a device may have no end.
///
/// # Errors
///
/// [`Error::Read`] if it is not, or does not exist.
pub(super) fn check_file(path: &Path) -> Result<()> {
    check_regular(path).map_err(|error| Error::read(path, error))
}

/// Reads the bytes of a regular file.
///
/// # Errors
///
/// The errors of [`check_file`], and [`Error::Read`] where the system cannot read.
pub(super) fn bytes(path: &Path) -> Result<Vec<u8>> {
    check_file(path)?;
    fs::read(path).map_err(|error| Error::read(path, error))
}

/// Reads width and height from an image's header.
///
/// # Errors
///
/// The errors of [`decode`].
pub(super) fn size(path: &Path) -> Result<[u32; 2]> {
    let (reader, unreadable) = opened(path, None)?;
    reader.into_dimensions().map(<[u32; 2]>::from).map_err(unreadable)
}

/// The formats of images for textures.
const PAINT: &str = "PNG, JPEG, BMP or TGA";

type Opened = (ImageReader<BufReader<File>>, Box<dyn Fn(ImageError) -> Error>);

/// Opens an image file; also returns a function that describes what is wrong with it.
fn opened(path: &Path, format: Option<ImageFormat>) -> Result<Opened> {
    let called = if format.is_some() { "PNG" } else { PAINT };
    let of = path.to_owned();
    let unreadable = move |e: ImageError| Error::malformed(&of, format!("not a readable {called}: {e}"));
    check_file(path)?;
    let mut reader = ImageReader::open(path).map_err(|e| Error::read(path, e))?;
    match format {
        Some(format) => reader.set_format(format),
        // The extension decides where the first bytes do not, as for TGA.
        None => reader = reader.with_guessed_format().map_err(|e| Error::read(path, e))?,
    }
    // [`MOST_PIXELS`] is the limit; the library's default is lower than the sizes that epsplat
    // writes.
    reader.no_limits();
    Ok((reader, Box::new(unreadable)))
}

/// Decodes the image at `path`.
///
/// If `format` is None, the format is one of those for textures, detected from the file's first
/// bytes or extension. `each` is the number of bytes a pixel that the caller will allocate.
///
/// # Errors
///
/// [`Error::Read`] where the system cannot read, [`Error::Malformed`] for an image of another
/// format, or one that is too large.
pub(super) fn decode(path: &Path, format: Option<ImageFormat>, each: u64) -> Result<DynamicImage> {
    let (reader, unreadable) = opened(path, format)?;
    let decoder = reader.into_decoder().map_err(&unreadable)?;
    let (width, height) = decoder.dimensions();
    let own = u64::from(decoder.color_type().bytes_per_pixel());
    check(path, (width.into(), height.into()), own + each)?;
    DynamicImage::from_decoder(decoder).map_err(unreadable)
}

/// A decoder of an image for textures, and a function that describes what is wrong with it.
#[cfg(feature = "gltf")]
fn decoder<'a>(path: &'a Path, bytes: &'a [u8]) -> Result<(impl ImageDecoder + 'a, impl Fn(ImageError) -> Error + 'a)> {
    let unreadable = |e: ImageError| Error::malformed(path, format!("not a readable {PAINT}: {e}"));
    let mut reader = ImageReader::new(std::io::Cursor::new(bytes));
    reader = reader.with_guessed_format().map_err(|e| Error::read(path, e))?;
    reader.no_limits();
    Ok((reader.into_decoder().map_err(unreadable)?, unreadable))
}

/// Reads width and height from the header of an image in `bytes` of the file at `path`.
///
/// # Errors
///
/// The errors of [`decode`].
#[cfg(feature = "gltf")]
pub(super) fn size_of_bytes(path: &Path, bytes: &[u8]) -> Result<[u32; 2]> {
    decoder(path, bytes).map(|(decoder, _)| decoder.dimensions().into())
}

/// Decodes an image for textures from `bytes` in a file at `path`.
///
/// # Errors
///
/// The errors of [`decode`].
#[cfg(feature = "gltf")]
pub(super) fn decode_bytes(path: &Path, bytes: &[u8], each: u64) -> Result<DynamicImage> {
    let (decoder, unreadable) = decoder(path, bytes)?;
    let (width, height) = decoder.dimensions();
    let own = u64::from(decoder.color_type().bytes_per_pixel());
    check(path, (width.into(), height.into()), own + each)?;
    DynamicImage::from_decoder(decoder).map_err(unreadable)
}
