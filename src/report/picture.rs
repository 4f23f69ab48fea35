//! Pictures inside the page: PNG as data URIs, no larger than the page needs.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::text::escape;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::io::png;

/// Longest side on the page, pixels. Larger pictures are shrunk by a whole factor.
const LARGEST_SIDE: u32 = 512;

/// Up to this many pictures have sides of [`LARGEST_SIDE`]. If there are more, all are smaller,
/// down to a quarter: a sweep has hundreds, and the page is one file.
const MANY: usize = 32;

/// Returns the longest side of each of `pictures` pictures.
pub(super) fn largest_side(pictures: usize) -> u32 {
    let share = (MANY as f64 / pictures.max(1) as f64).sqrt().clamp(0.25, 1.0);
    (f64::from(LARGEST_SIDE) * share) as u32
}

/// A grid of values, row by row from the top.
pub(super) struct Grid<T> {
    pub width: u32,
    pub height: u32,
    pub values: Vec<T>,
}

/// Returns the whole factor that shrinks the sides of a picture to at most `side`.
pub(super) fn shrink_factor(width: u32, height: u32, side: u32) -> u32 {
    width.max(height).div_ceil(side).max(1)
}

/// Reduces each block of pixels to one, so that both sides are at most `side`. Blocks at the right
/// and bottom edges may be smaller.
pub(super) fn shrink<T: Copy>([width, height, side]: [u32; 3], values: &[T], reduce: impl Fn(&[T]) -> T) -> Grid<T> {
    let factor = shrink_factor(width, height, side) as usize;
    if factor == 1 {
        return Grid { width, height, values: values.to_vec() };
    }
    let mut block = Vec::with_capacity(factor * factor);
    let (columns, rows) = (width as usize, height as usize);
    let mut small = Vec::new();
    for top in (0..rows).step_by(factor) {
        for left in (0..columns).step_by(factor) {
            let right = (left + factor).min(columns);
            block.clear();
            for row in top..(top + factor).min(rows) {
                block.extend_from_slice(&values[row * columns + left..row * columns + right]);
            }
            small.push(reduce(&block));
        }
    }
    Grid { width: width.div_ceil(factor as u32), height: height.div_ceil(factor as u32), values: small }
}

/// Encodes the colours of a frame, shrunk to sides of at most `side`, as an `img` element.
pub(super) fn of_frame(frame: &Frame, side: u32, alt: &str) -> Result<String> {
    let small = shrink([frame.width, frame.height, side], &frame.color, mean);
    image(small.width, small.height, &png::srgb_bytes(&small.values), alt)
}

/// Averages linear colours with straight alpha, weighted by alpha.
fn mean(block: &[[f32; 4]]) -> [f32; 4] {
    let alpha: f32 = block.iter().map(|color| color[3]).sum();
    if alpha <= 0.0 {
        return [0.0; 4];
    }
    let [r, g, b] = [0, 1, 2].map(|c| block.iter().map(|color| color[c] * color[3]).sum::<f32>() / alpha);
    [r, g, b, alpha / block.len() as f32]
}

/// Encodes sRGB bytes, four per pixel, as an `img` element.
pub(super) fn image(width: u32, height: u32, rgba: &[u8], alt: &str) -> Result<String> {
    let mut bytes = Vec::new();
    png::encode(&mut bytes, width, height, rgba)
        .map_err(|e| Error::Usage(format!("an image of {width}x{height} cannot be shown on the page: {e}")))?;
    let (data, alt) = (STANDARD.encode(&bytes), escape(alt));
    Ok(format!(r#"<img src="data:image/png;base64,{data}" width="{width}" height="{height}" alt="{alt}"/>"#))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_pictures_are_kept_and_large_ones_shrunk_in_blocks() {
        assert_eq!(
            [(1, 1), (512, 10), (513, 10), (5000, 9)].map(|(width, height)| shrink_factor(width, height, 512)),
            [1, 1, 2, 10]
        );
        let values: Vec<u32> = (0..513 * 3).collect();
        let largest = |block: &[u32]| block.iter().copied().max().unwrap_or(0);
        let small = shrink([513, 3, 512], &values, largest);
        assert_eq!((small.width, small.height, small.values.len()), (257, 2, 257 * 2));
        assert_eq!((small.values[0], small.values[256]), (514, 513 + 512));
        assert_eq!(small.values.last(), Some(&(513 * 3 - 1)));
        assert_eq!(shrink([2, 1, 512], &[4, 5], largest).values, [4, 5]);
    }

    #[test]
    fn many_pictures_are_smaller() {
        assert_eq!([1, 32, 128, 100_000].map(largest_side), [512, 512, 256, 128]);
    }

    #[test]
    fn transparent_pixels_do_not_darken_their_neighbours() {
        assert_eq!(mean(&[[1.0, 0.5, 0.0, 1.0], [0.0; 4]]), [1.0, 0.5, 0.0, 0.5]);
        assert_eq!(mean(&[[9.0, 9.0, 9.0, 0.0]]), [0.0; 4]);
    }
}
