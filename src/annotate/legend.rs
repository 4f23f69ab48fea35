//! A legend: a colour bar with ticks, or a swatch for each category.

use super::canvas::{Canvas, INK, PANEL};
use super::text;
use super::ticks::ticks;
use crate::scene::{ColorKey, ColorMap, KeyColors};

/// The most categories that are named.
const MOST: usize = 24;

/// A row of a legend: its text, and for a category its colour.
type Row = (String, Option<[u8; 3]>);

/// The sizes of a legend, pixels.
struct Sizes {
    letters: f32,
    /// Space around the content, and between a swatch and its text.
    gap: i64,
    /// Height of a row.
    row: i64,
    /// Width of the bar and of swatches.
    swatch: i64,
    /// Height of the bar.
    bar: i64,
}

impl Sizes {
    fn of(canvas: &Canvas<'_>, letters: f32) -> Self {
        let pixels = |factor: f32| (letters * factor).round().max(1.0) as i64;
        Self {
            letters,
            gap: pixels(0.6),
            row: pixels(1.35),
            swatch: pixels(1.2),
            bar: (canvas.height as f32 * 0.42).round() as i64,
        }
    }
}

/// The heading: the attribute with its unit.
pub(super) fn heading(key: &ColorKey) -> Vec<String> {
    match key.unit {
        // A long unit has a line of its own.
        Some(unit) if unit.len() > 8 => vec![key.name.clone(), unit.to_owned()],
        Some(unit) => vec![format!("{} ({unit})", key.name)],
        None => vec![key.name.clone()],
    }
}

/// The rows of categories.
fn rows(named: &[(String, [u8; 3])]) -> Vec<Row> {
    let mut rows: Vec<Row> = named.iter().take(MOST).map(|(name, code)| (name.clone(), Some(*code))).collect();
    if let Some(more) = named.len().checked_sub(MOST).filter(|more| *more > 0) {
        rows.push((format!("and {more} more"), None));
    }
    rows
}

/// The rows of unit vectors: the colours of the axes.
fn axes() -> Vec<Row> {
    let row = |(axis, code): (&str, [u8; 3])| (axis.to_owned(), Some(code));
    [("+x", [255, 128, 128]), ("+y", [128, 255, 128]), ("+z", [128, 128, 255])].map(row).into()
}

/// Draws a legend at the right edge of the picture, halfway up. It is made smaller until it fits.
pub(super) fn draw(canvas: &mut Canvas<'_>, key: &ColorKey) {
    let (heading, mut letters) = (heading(key), canvas.letters());
    let (map, rows, labels) = match &key.colors {
        KeyColors::Ramp { map, ends } => (Some(*map), Vec::new(), ticks(*ends, 5)),
        KeyColors::Categories(named) => (None, rows(named), Vec::new()),
        KeyColors::Vectors => (None, axes(), Vec::new()),
    };
    let size = |sizes: &Sizes| {
        let width = |text: &String| text::width(text, sizes.letters).ceil() as i64;
        let beside = labels.iter().map(|(_, label)| label).chain(rows.iter().map(|(name, _)| name)).map(width).max();
        let content = sizes.swatch + sizes.gap + beside.unwrap_or(0);
        let height = if map.is_some() { sizes.bar + sizes.row } else { sizes.row * rows.len() as i64 };
        let wide = heading.iter().map(width).max().unwrap_or(0).max(content);
        [wide + 2 * sizes.gap, sizes.row * heading.len() as i64 + height + 2 * sizes.gap]
    };
    let mut sizes = Sizes::of(canvas, letters);
    let room = [canvas.width as i64, canvas.height as i64];
    while letters > 4.0 && (0..2).any(|axis| size(&sizes)[axis] > room[axis]) {
        letters *= 0.9;
        sizes = Sizes::of(canvas, letters);
    }
    let [width, height] = size(&sizes);
    let [left, top] = [room[0] - width - sizes.gap.min((room[0] - width).max(0)), (room[1] - height) / 2];
    canvas.fill([left, top], [width, height], PANEL);
    let (x, mut y) = (left + sizes.gap, top + sizes.gap);
    for line in &heading {
        text::draw(canvas, line, [x as f32, y as f32], sizes.letters, INK);
        y += sizes.row;
    }
    match (map, &key.colors) {
        (Some(map), KeyColors::Ramp { ends, .. }) => bar(canvas, (map, *ends), &labels, [x, y + sizes.row / 2], &sizes),
        _ => swatches(canvas, &rows, [x, y], &sizes),
    }
}

/// Draws the colour bar, whose upper end is the greatest value, and its ticks.
fn bar(
    canvas: &mut Canvas<'_>,
    (map, [low, high]): (ColorMap, [f64; 2]),
    labels: &[(f64, String)],
    [x, y]: [i64; 2],
    sizes: &Sizes,
) {
    let last = (sizes.bar - 1).max(1);
    for row in 0..sizes.bar {
        let [r, g, b] = map.code(1.0 - row as f64 / last as f64);
        canvas.fill([x, y + row], [sizes.swatch, 1], [r, g, b, 255]);
    }
    for (value, label) in labels {
        let share = if low < high { (value - low) / (high - low) } else { 0.5 };
        let at = y + ((1.0 - share) * last as f64).round() as i64;
        let thick = (sizes.letters / 12.0).round().max(1.0) as i64;
        canvas.fill([x + sizes.swatch, at - thick / 2], [sizes.gap / 2, thick], INK);
        let corner = [(x + sizes.swatch + sizes.gap) as f32, at as f32 - sizes.letters / 2.0];
        text::draw(canvas, label, corner, sizes.letters, INK);
    }
}

/// Draws a swatch and a name for each category.
fn swatches(canvas: &mut Canvas<'_>, rows: &[Row], [x, mut y]: [i64; 2], sizes: &Sizes) {
    for (name, code) in rows {
        if let Some([r, g, b]) = *code {
            let inset = sizes.row / 8;
            canvas.fill([x, y + inset], [sizes.swatch, sizes.row - 2 * inset], [r, g, b, 255]);
        }
        let corner = [(x + sizes.swatch + sizes.gap) as f32, y as f32 + (sizes.row as f32 - sizes.letters) / 2.0];
        text::draw(canvas, name, corner, sizes.letters, INK);
        y += sizes.row;
    }
}
