//! JPEG: 8-bit sRGB over white.

use std::io;

use ::image::codecs::jpeg::JpegEncoder;
use ::image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;

use super::{Image, Sink};
use crate::scene::color::srgb8_of;

/// The quality, 1 to 100.
const QUALITY: u8 = 95;

pub(super) fn encode(sink: &mut dyn Sink, image: &Image<'_>) -> io::Result<()> {
    let (width, height) = (image.frame.width, image.frame.height);
    let bytes = image.frame.color.par_iter().copied().map(over_white).collect::<Vec<_>>().into_flattened();
    let encoder = JpegEncoder::new_with_quality(sink, QUALITY);
    encoder.write_image(&bytes, width, height, ExtendedColorType::Rgb8).map_err(io::Error::other)
}

/// Returns the sRGB codes of a linear colour with straight alpha over white.
fn over_white([r, g, b, a]: [f32; 4]) -> [u8; 3] {
    let a = a.clamp(0.0, 1.0);
    [r, g, b].map(|c| srgb8_of(if a > 0.0 { c * a + (1.0 - a) } else { 1.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_composed_in_linear_light() {
        assert_eq!(over_white([0.0, 0.0, 0.0, 0.0]), [255; 3]);
        assert_eq!(over_white([0.0, 0.5, 1.0, 1.0]), [0, 188, 255]);
        // Half of white in linear light is the code 188, not 128.
        assert_eq!(over_white([0.0, 0.0, 0.0, 0.5]), [188; 3]);
    }
}
