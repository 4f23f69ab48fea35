//! PNG: the colour as 8-bit sRGB, or depths as 16-bit integers with a stated scale.

use std::io;

use ::image::codecs::png::PngEncoder;
use ::image::{ExtendedColorType, ImageEncoder};
use rayon::prelude::*;

use super::{Content, Image, Sink, color_alone};
use crate::io::png;
use crate::scene::{Map, Maps};

/// The largest value of a pixel.
const MOST: f64 = 65_535.0;

pub(super) fn content(maps: Maps, scale: Option<f64>) -> Result<Content, &'static str> {
    let depth = maps == Maps::of(&[Map::Depth]);
    match scale {
        Some(scale) if depth => Ok(Content::ScaledDepth(scale)),
        _ => color_alone(
            maps,
            scale,
            "a PNG holds no maps, except depth with --depth-scale: use an .exr or .npz output with --aov",
        ),
    }
}

pub(super) fn encode(sink: &mut dyn Sink, image: &Image<'_>) -> io::Result<()> {
    let (width, height) = (image.frame.width, image.frame.height);
    let Content::ScaledDepth(scale) = image.content else {
        let bytes = png::srgb_bytes(&image.frame.color);
        return png::encode(sink, width, height, &bytes).map_err(io::Error::other);
    };
    let values = scaled(image.frame.map(Map::Depth).unwrap_or_default(), scale).map_err(io::Error::other)?;
    // The encoder takes the bytes of native integers.
    let bytes: &[u8] = bytemuck::cast_slice(&values);
    PngEncoder::new(sink).write_image(bytes, width, height, ExtendedColorType::L16).map_err(io::Error::other)
}

/// Converts depths, world units, to integers. Pixels without a surface become 0.
///
/// # Errors
///
/// A sentence if a depth does not fit, or would become 0.
fn scaled(depths: &[f32], scale: f64) -> Result<Vec<u16>, String> {
    let rounded = |depth: f32| (f64::from(depth) * scale).round();
    let finite = depths.par_iter().copied().filter(|depth| depth.is_finite());
    let [least, most] = finite
        .map(|depth| [depth, depth])
        .reduce(|| [f32::INFINITY, f32::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    if most > f32::NEG_INFINITY && rounded(most) > MOST {
        let fits = fitting(MOST / f64::from(most));
        return Err(format!("the depth {most} times the scale {scale} exceeds {MOST}: --depth-scale {fits} fits"));
    }
    if least < f32::INFINITY && rounded(least) < 1.0 {
        return Err(format!(
            "the depth {least} times the scale {scale} is rounded to 0, which means that nothing is there: give a larger \
             --depth-scale"
        ));
    }
    Ok(depths.par_iter().map(|depth| if depth.is_finite() { rounded(*depth) as u16 } else { 0 }).collect())
}

/// Returns the largest number of the form 1, 2 or 5 times a power of ten that is at most `most`.
fn fitting(most: f64) -> f64 {
    let power = 10f64.powf(most.log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|digit| digit * power).find(|scale| *scale <= most).unwrap_or(most)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn depths_are_rounded_and_nothing_is_zero() {
        let depths = [f32::INFINITY, 0.001, 1.2345, 65.5354];
        assert_eq!(scaled(&depths, 1000.0).unwrap(), [0, 1, 1235, 65535]);
        assert!(scaled(&[f32::INFINITY], 1e9).unwrap() == [0]);
    }

    #[test]
    fn a_scale_that_fits_is_said() {
        let said = scaled(&[80.0, f32::INFINITY], 1000.0).unwrap_err();
        assert!(said.contains("--depth-scale 500 fits"), "{said}");
        assert!(scaled(&[80.0], 500.0).is_ok());
        assert!(scaled(&[0.0001], 1000.0).unwrap_err().contains("larger --depth-scale"));
        for (most, fits) in [(819.2, 500.0), (1.0, 1.0), (0.03, 0.02), (99.0, 50.0)] {
            assert!((fitting(most) / fits - 1.0).abs() < 1e-12, "{most}");
        }
    }
}
