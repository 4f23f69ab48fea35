//! TIFF, with a place on the earth if there is one: the colour as 8-bit sRGB with straight alpha,
//! or a map as f32. Strips of rows are written as they come, so an image need not fit in memory.

use std::io;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use rayon::prelude::*;
use tiff::TiffError;
use tiff::encoder::{DirectoryEncoder, TiffEncoder, TiffKind};
use tiff::tags::Tag;

use super::{Content, Image, Sink, color_or_map};
use crate::frame::Frame;
use crate::io::place::Place;
use crate::io::png::srgb_bytes;
use crate::scene::Maps;

/// The approximate size of a strip, bytes.
const STRIP: usize = 1 << 18;

/// Images with more bytes are BigTIFF files, as offsets of 32 bits end at 4 GiB.
const CLASSIC: u64 = 0xf000_0000;

/// The value where nothing is visible, as GDAL reads it. No number would do: -9999 is a depth of
/// some seas.
const NOTHING: &str = "nan";

/// The size of an image, and what it shows.
#[derive(Clone, Copy)]
pub struct Layout<'a> {
    /// The number of pixels in a row.
    pub width: u32,
    /// The number of rows.
    pub height: u32,
    /// The colour or a map.
    pub content: Content,
    /// The place on the earth.
    pub place: Option<&'a Place>,
}

/// Takes the next rows of an image.
pub type Rows<'a> = dyn FnMut(&Frame) -> io::Result<()> + 'a;

pub(super) fn content(maps: Maps, scale: Option<f64>) -> Result<Content, &'static str> {
    let content = color_or_map(maps, scale, "a TIFF holds one map or the colour: give one map, or use .exr or .npz")?;
    match content {
        Content::Map(map) if map.row().numbers || !matches!(map.width(), 1 | 3) => {
            Err("a TIFF holds maps of one or three numbers: use an .exr or .npz output for this map")
        }
        content => Ok(content),
    }
}

pub(super) fn encode(sink: &mut dyn Sink, image: &Image<'_>) -> io::Result<()> {
    let Frame { width, height, .. } = *image.frame;
    let layout = Layout { width, height, content: image.content, place: image.place };
    write(sink, &layout, |rows| rows(image.frame))
}

/// Writes an image whose rows `fill` gives, from the top, in parts of any height.
///
/// # Errors
///
/// Where the system cannot write, or the error of `fill`.
pub fn write(
    sink: &mut dyn Sink,
    layout: &Layout<'_>,
    fill: impl FnOnce(&mut Rows<'_>) -> io::Result<()>,
) -> io::Result<()> {
    let bytes = u64::from(layout.width) * u64::from(layout.height) * 4 * layout.numbers() as u64;
    if bytes > CLASSIC {
        strips(&mut TiffEncoder::new_big(sink).map_err(of_tiff)?, layout, fill)
    } else {
        strips(&mut TiffEncoder::new(sink).map_err(of_tiff)?, layout, fill)
    }
}

impl Layout<'_> {
    /// The number of f32 in a pixel; the four bytes of a colour count as one.
    fn numbers(&self) -> usize {
        if let Content::Map(map) = self.content { map.width() } else { 1 }
    }

    /// The bytes of a row.
    fn row(&self) -> usize {
        4 * self.width as usize * self.numbers()
    }

    /// The rows of a strip.
    fn strip(&self) -> usize {
        (STRIP / self.row()).clamp(1, self.height as usize)
    }
}

fn strips<K: TiffKind>(
    encoder: &mut TiffEncoder<&mut dyn Sink, K>,
    layout: &Layout<'_>,
    fill: impl FnOnce(&mut Rows<'_>) -> io::Result<()>,
) -> io::Result<()> {
    let mut directory = encoder.image_directory().map_err(of_tiff)?;
    let size = layout.strip() * layout.row();
    let (mut pending, mut offsets, mut counts) = (Vec::new(), Vec::new(), Vec::new());
    let mut give = |bytes: &[u8]| -> io::Result<()> {
        let packed: Vec<Vec<u8>> =
            bytes.par_chunks(size).map(|strip| packed(strip, layout)).collect::<io::Result<_>>()?;
        for strip in packed {
            let offset = directory.write_data(strip.as_slice()).map_err(of_tiff)?;
            offsets.push(K::convert_offset(offset).map_err(of_tiff)?);
            counts.push(K::convert_offset(strip.len() as u64).map_err(of_tiff)?);
        }
        Ok(())
    };
    fill(&mut |frame| {
        pending.extend(bytes_of(frame, layout.content));
        let whole = pending.len() / size * size;
        give(&pending[..whole])?;
        pending.drain(..whole);
        Ok(())
    })?;
    give(&pending)?;
    tags(&mut directory, layout).map_err(of_tiff)?;
    directory.write_tag(Tag::StripOffsets, K::convert_slice(&offsets)).map_err(of_tiff)?;
    directory.write_tag(Tag::StripByteCounts, K::convert_slice(&counts)).map_err(of_tiff)?;
    directory.finish().map_err(of_tiff)
}

/// Returns the error of the system, if it is one.
fn of_tiff(error: TiffError) -> io::Error {
    match error {
        TiffError::IoError(error) => error,
        other => io::Error::other(other),
    }
}

/// Returns the bytes of all pixels: sRGB codes, or f32 in the machine's order.
fn bytes_of(frame: &Frame, content: Content) -> Vec<u8> {
    let Content::Map(map) = content else { return srgb_bytes(&frame.color) };
    let values = frame.map(map).unwrap_or_default();
    let number = |value: &f32| if value.is_finite() { *value } else { f32::NAN };
    values.par_iter().map(|value| number(value).to_ne_bytes()).collect::<Vec<_>>().into_flattened()
}

/// Compresses a strip. Codes are stored as differences to the pixel on the left.
fn packed(strip: &[u8], layout: &Layout<'_>) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    if matches!(layout.content, Content::Map(_)) {
        io::Write::write_all(&mut encoder, strip)?;
        return encoder.finish();
    }
    let mut bytes = strip.to_vec();
    for row in bytes.chunks_mut(layout.row()) {
        for at in (4..row.len()).rev() {
            row[at] = row[at].wrapping_sub(row[at - 4]);
        }
    }
    io::Write::write_all(&mut encoder, &bytes)?;
    encoder.finish()
}

fn tags<K: TiffKind>(
    directory: &mut DirectoryEncoder<'_, &mut dyn Sink, K>,
    layout: &Layout<'_>,
) -> tiff::TiffResult<()> {
    /// Values of tags: Deflate, black is zero, red green blue, straight alpha, f32.
    const DEFLATE: u16 = 8;
    const GREY: u16 = 1;
    const RGB: u16 = 2;
    const STRAIGHT: u16 = 2;
    const FLOAT: u16 = 3;
    directory.write_tag(Tag::ImageWidth, layout.width)?;
    directory.write_tag(Tag::ImageLength, layout.height)?;
    directory.write_tag(Tag::RowsPerStrip, layout.strip() as u32)?;
    directory.write_tag(Tag::Compression, DEFLATE)?;
    let numbers = layout.numbers();
    if matches!(layout.content, Content::Map(_)) {
        directory.write_tag(Tag::PhotometricInterpretation, if numbers == 1 { GREY } else { RGB })?;
        directory.write_tag(Tag::BitsPerSample, &vec![32u16; numbers][..])?;
        directory.write_tag(Tag::SampleFormat, &vec![FLOAT; numbers][..])?;
        directory.write_tag(Tag::SamplesPerPixel, numbers as u16)?;
        directory.write_tag(Tag::GdalNodata, NOTHING)?;
    } else {
        directory.write_tag(Tag::PhotometricInterpretation, RGB)?;
        directory.write_tag(Tag::BitsPerSample, &[8u16; 4][..])?;
        directory.write_tag(Tag::SamplesPerPixel, 4u16)?;
        directory.write_tag(Tag::ExtraSamples, STRAIGHT)?;
        directory.write_tag(Tag::Predictor, 2u16)?;
    }
    let Some(Place { left, top, pixel, keys }) = layout.place else { return Ok(()) };
    directory.write_tag(Tag::ModelPixelScaleTag, &[*pixel, *pixel, 0.0][..])?;
    directory.write_tag(Tag::ModelTiepointTag, &[0.0, 0.0, 0.0, *left, *top, 0.0][..])?;
    // Without keys a pixel is an area too.
    if !keys.is_empty() {
        directory.write_tag(Tag::GeoKeyDirectoryTag, &keys.directory()[..])?;
    }
    if !keys.doubles.is_empty() {
        directory.write_tag(Tag::GeoDoubleParamsTag, &keys.doubles[..])?;
    }
    if !keys.texts.is_empty() {
        directory.write_tag(Tag::GeoAsciiParamsTag, keys.texts.as_str())?;
    }
    Ok(())
}
