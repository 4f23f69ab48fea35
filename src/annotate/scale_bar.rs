//! A scale bar: a line whose length is a round number of the scene's units.

use super::canvas::{Canvas, INK, PANEL};
use super::text;
use super::ticks::{label, round_length};

/// The largest share of the picture's width that the bar takes.
const SHARE: f64 = 0.25;

/// The length of the bar in units of the scene, and its label, in a picture of this width and scale
/// (pixels per unit).
pub(super) fn length(width: usize, scale: f64) -> (f64, String) {
    let length = round_length(SHARE * width as f64 / scale);
    let decimals = (-length.log10().floor()).max(0.0) as usize;
    let unit = if length == 1.0 { "unit" } else { "units" };
    (length, format!("{} {unit}", label(length, decimals)))
}

/// Draws the bar in the lower left corner; `scale` is in pixels per unit.
pub(super) fn draw(canvas: &mut Canvas<'_>, scale: f64) {
    let (length, name) = length(canvas.width, scale);
    let letters = canvas.letters();
    let pixels = |factor: f32| (letters * factor).round().max(1.0) as i64;
    let (gap, row, end) = (pixels(0.6), pixels(1.35), pixels(0.6));
    let bar = (length * scale).round() as i64;
    let wide = bar.max(text::width(&name, letters).ceil() as i64);
    let [width, height] = [wide + 2 * gap, row + end + 2 * gap];
    let [left, top] = [gap, canvas.height as i64 - height - gap];
    canvas.fill([left, top], [width, height], PANEL);
    let x = left + gap + (wide - bar) / 2;
    let thick = pixels(0.12);
    let label = [left as f32 + (width as f32 - text::width(&name, letters)) / 2.0, (top + gap) as f32];
    text::draw(canvas, &name, label, letters, INK);
    let base = top + height - gap;
    canvas.fill([x, base - thick], [bar, thick], INK);
    canvas.fill([x, base - end], [thick, end], INK);
    canvas.fill([x + bar - thick, base - end], [thick, end], INK);
}
