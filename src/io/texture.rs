//! Images that meshes are painted with.

use std::path::Path;

use image::ImageReader;

use crate::error::{Error, Result};
use crate::scene::color::SRGB8_TO_LINEAR;

/// No texture has more pixels.
const LARGEST: u64 = 1 << 28;

/// An image of 8-bit sRGB colours with straight alpha.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    width: u32,
    height: u32,
    /// Rows from the top.
    texels: Vec<[u8; 4]>,
}

impl Texture {
    /// An image of `width` x `height` texels, rows from the top; None if there are not as many, or none.
    pub fn new(width: u32, height: u32, texels: Vec<[u8; 4]>) -> Option<Self> {
        let count = u64::from(width) * u64::from(height);
        (count > 0 && count == texels.len() as u64).then_some(Self { width, height, texels })
    }

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

    /// The colour at texture coordinates (u, v), origin bottom left: linear RGB, straight alpha. Between the middles of texels
    /// it is interpolated, premultiplied and in linear light; beyond [0, 1] the image is repeated.
    pub fn at(&self, u: f32, v: f32) -> [f32; 4] {
        // What is not a number has no place; that of 0 serves.
        let place = |turns: f32, size: u32| {
            let turns = f64::from(if turns.is_finite() { turns } else { 0.0 });
            let at = (turns - turns.floor()) * f64::from(size) - 0.5;
            let low = at.floor();
            ([low, low + 1.0].map(|k| (k as i64).rem_euclid(size.into()) as usize), at - low)
        };
        let ((columns, right), (rows, down)) = (place(u, self.width), place(1.0 - v, self.height));
        let mut sum = [0.0; 4];
        for (row, weight_y) in rows.into_iter().zip([1.0 - down, down]) {
            for (column, weight_x) in columns.into_iter().zip([1.0 - right, right]) {
                let [r, g, b, a] = self.texels[row * self.width as usize + column];
                let covers = weight_x * weight_y * f64::from(a) / 255.0;
                let light = [r, g, b].map(|code| covers * f64::from(SRGB8_TO_LINEAR[usize::from(code)]));
                sum = [sum[0] + light[0], sum[1] + light[1], sum[2] + light[2], sum[3] + covers];
            }
        }
        let [r, g, b, a] = sum;
        if a > 0.0 { [r / a, g / a, b / a, a].map(|c| c as f32) } else { [0.0; 4] }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn texels_lie_where_obj_says_and_repeat() {
        let (red, blue, green, clear) = ([255, 0, 0, 255], [0, 0, 255, 255], [0, 255, 0, 255], [9, 9, 9, 0]);
        let texture = Texture::new(2, 2, vec![red, blue, green, clear]).unwrap();
        // v points up, so the first row is at v = 3/4.
        assert_eq!(texture.at(0.25, 0.75), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!(texture.at(0.75, 0.75), [0.0, 0.0, 1.0, 1.0]);
        assert_eq!(texture.at(0.25, 0.25), [0.0, 1.0, 0.0, 1.0]);
        assert_eq!(texture.at(-1.75, 2.75), [1.0, 0.0, 0.0, 1.0]);
        // Between red and blue, in linear light, and across the seam too; what is clear has no colour to give.
        assert_eq!(texture.at(0.5, 0.75), [0.5, 0.0, 0.5, 1.0]);
        assert_eq!(texture.at(0.0, 0.75), [0.5, 0.0, 0.5, 1.0]);
        assert_eq!(texture.at(0.5, 0.25), [0.0, 1.0, 0.0, 0.5]);
        assert!(texture.at(f32::NAN, f32::INFINITY).iter().all(|c| c.is_finite()));
        assert!(Texture::new(2, 2, vec![red]).is_none() && Texture::new(0, 2, vec![]).is_none());
    }
}
