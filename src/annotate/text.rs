//! Labels in the letters of DejaVu Sans, of which `labels.ttf` has those that labels need.

use std::sync::LazyLock;

use ab_glyph::{Font, FontRef, PxScale, ScaleFont, point};

use super::canvas::Canvas;
use crate::scene::color::decoded;

static FONT: LazyLock<Option<FontRef<'static>>> =
    LazyLock::new(|| FontRef::try_from_slice(include_bytes!("labels.ttf")).ok());

/// The letter that stands for all that the font lacks.
const UNKNOWN: char = '\u{fffd}';

/// The letters of a text that the font has.
fn letters<'a>(font: &'a FontRef<'static>, text: &'a str) -> impl Iterator<Item = ab_glyph::GlyphId> + 'a {
    text.chars().map(|letter| match font.glyph_id(letter) {
        none if none.0 == 0 => font.glyph_id(UNKNOWN),
        known => known,
    })
}

/// The width of a text in letters of this size, pixels.
pub(super) fn width(text: &str, size: f32) -> f32 {
    let Some(font) = &*FONT else { return 0.0 };
    let scaled = font.as_scaled(PxScale::from(size));
    letters(font, text).map(|letter| scaled.h_advance(letter)).sum()
}

/// Draws a text. `corner` is the upper left one of its line, which is `size` pixels high.
pub(super) fn draw(canvas: &mut Canvas<'_>, text: &str, corner: [f32; 2], size: f32, code: [u8; 4]) {
    let Some(font) = &*FONT else { return };
    let scaled = font.as_scaled(PxScale::from(size));
    let color = decoded(code);
    let (mut x, y) = (corner[0], corner[1] + scaled.ascent());
    for letter in letters(font, text) {
        let glyph = letter.with_scale_and_position(PxScale::from(size), point(x, y));
        x += scaled.h_advance(letter);
        if let Some(outline) = font.outline_glyph(glyph) {
            let corner = outline.px_bounds().min;
            let (left, top) = (corner.x as i64, corner.y as i64);
            let mut cover = |x: u32, y: u32, share: f32| {
                // Dark letters that are mixed in linear light look thin, as eyes judge sRGB codes.
                let share = 1.0 - (1.0 - share.clamp(0.0, 1.0)).powf(2.2);
                canvas.cover(left + i64::from(x), top + i64::from(y), color, share);
            };
            outline.draw(&mut cover);
        }
    }
}
