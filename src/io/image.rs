//! Images that are read: one limit of their size for all, found in the header before anything is allocated.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

use ::image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader};

use super::input::check_regular;
use crate::error::{Error, Result};

/// The most pixels of an image that is read: a picture of 16384x16384, as textures of scans are.
pub const MOST_PIXELS: u64 = 1 << 28;

/// Refuses an image of more than [`MOST_PIXELS`], and one that the system has no memory for, `each` bytes a pixel.
///
/// # Errors
///
/// [`Error::Malformed`] for the first, [`Error::Read`] for the second.
pub(super) fn check(path: &Path, (width, height): (u64, u64), each: u64) -> Result<()> {
    let pixels = width.saturating_mul(height);
    if pixels > MOST_PIXELS {
        let what =
            format!("an image of at most {MOST_PIXELS} pixels is read, not of {width}x{height}: make it smaller");
        return Err(Error::malformed(path, what));
    }
    check_room(path, pixels.saturating_mul(each))
}

/// Makes sure that the system gives so many bytes, which what is made of the file at `path` is about to take. They are given
/// back at once: decoders ask for them in parts, and end the program where they get none.
///
/// # Errors
///
/// [`Error::Read`].
pub fn check_room(path: &Path, bytes: u64) -> Result<()> {
    let bytes = usize::try_from(bytes).unwrap_or(usize::MAX);
    let room = Vec::<u8>::new().try_reserve_exact(bytes);
    room.map_err(|_| Error::read(path, std::io::ErrorKind::OutOfMemory.into()))
}

/// Makes sure that a file that is named by another one is a file: a pipe or a device may have no
/// end.
///
/// # Errors
///
/// [`Error::Read`].
pub(super) fn check_file(path: &Path) -> Result<()> {
    check_regular(path).map_err(|error| Error::read(path, error))
}

/// The bytes of a file.
///
/// # Errors
///
/// The errors of [`check_file`], and [`Error::Read`] where the system cannot read.
pub(super) fn bytes(path: &Path) -> Result<Vec<u8>> {
    check_file(path)?;
    fs::read(path).map_err(|error| Error::read(path, error))
}

/// Width and height of an image, by its header.
///
/// # Errors
///
/// The errors of [`decode`].
pub(super) fn size(path: &Path) -> Result<[u32; 2]> {
    let (reader, unreadable) = opened(path, None)?;
    reader.into_dimensions().map(<[u32; 2]>::from).map_err(unreadable)
}

/// The formats of pictures that surfaces are painted with.
const PAINT: &str = "PNG, JPEG, BMP or TGA";

type Opened = (ImageReader<BufReader<File>>, Box<dyn Fn(ImageError) -> Error>);

/// A file that is open as an image, and how what is wrong with it is said.
fn opened(path: &Path, format: Option<ImageFormat>) -> Result<Opened> {
    let called = if format.is_some() { "PNG" } else { PAINT };
    let of = path.to_owned();
    let unreadable = move |e: ImageError| Error::malformed(&of, format!("not a readable {called}: {e}"));
    check_file(path)?;
    let mut reader = ImageReader::open(path).map_err(|e| Error::read(path, e))?;
    match format {
        Some(format) => reader.set_format(format),
        // The name decides where the first bytes say nothing, as they do of TGA.
        None => reader = reader.with_guessed_format().map_err(|e| Error::read(path, e))?,
    }
    // The limit is ours; the library's is less than we write.
    reader.no_limits();
    Ok((reader, Box::new(unreadable)))
}

/// Decodes the image at `path`, a PNG, or without a `format` one that surfaces are painted with, by
/// its first bytes or its name. `each` is how many bytes a pixel what is made of it will take.
///
/// # Errors
///
/// [`Error::Read`] where the system cannot read, [`Error::Malformed`] for what is no such image or
/// too large.
pub(super) fn decode(path: &Path, format: Option<ImageFormat>, each: u64) -> Result<DynamicImage> {
    let (reader, unreadable) = opened(path, format)?;
    let decoder = reader.into_decoder().map_err(&unreadable)?;
    let (width, height) = decoder.dimensions();
    let own = u64::from(decoder.color_type().bytes_per_pixel());
    check(path, (width.into(), height.into()), own + each)?;
    DynamicImage::from_decoder(decoder).map_err(unreadable)
}
