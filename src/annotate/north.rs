//! An arrow to the north, which is +y of map coordinates.

use super::canvas::{Canvas, INK, PANEL};
use super::text;

/// Draws the arrow in the upper left corner; `north` is the direction in the picture, x to the
/// right and y down.
pub(super) fn draw(canvas: &mut Canvas<'_>, [x, y]: [f64; 2]) {
    let letters = canvas.letters();
    let reach = f64::from(letters) * 1.5;
    let length = x.hypot(y).max(f64::MIN_POSITIVE);
    let (x, y) = (x / length, y / length);
    let side = (2.0 * (reach + f64::from(letters) * 1.2)).round() as i64;
    let corner = (f64::from(letters) * 0.6).round() as i64;
    canvas.fill([corner; 2], [side; 2], PANEL);
    let center = corner as f64 + side as f64 / 2.0;
    let at = |along: f64, across: f64| {
        [center + reach * (along * x - across * y), center + reach * (along * y + across * x)]
    };
    // Two halves, so that the arrow has a notch.
    canvas.polygon(&[at(0.9, 0.0), at(-0.9, 0.55), at(-0.55, 0.0)], INK);
    canvas.polygon(&[at(0.9, 0.0), at(-0.9, -0.55), at(-0.55, 0.0)], INK);
    let place = at(0.9 + f64::from(letters) * 0.55 / reach, 0.0);
    let corner = [place[0] as f32 - text::width("N", letters) / 2.0, place[1] as f32 - letters / 2.0];
    text::draw(canvas, "N", corner, letters, INK);
}
