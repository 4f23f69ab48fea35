//! One plot as SVG: two logarithmic axes, lines, markers and names.
//!
//! It does not use `plotters`, because the page needs what that crate's SVG lacks: a class and a
//! tooltip on each marker, `title` and `desc` for screen readers, a flexible width, and names that
//! avoid each other. The rest is little more than the two axes.

use std::fmt::Write;

use super::family::Style;
use super::labels::{self, Area};
use super::text::escape;

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 370.0;
/// The rectangle of the values. Ticks and names of axes are outside.
const INSIDE: Area = Area { left: 66.0, top: 12.0, right: WIDTH - 10.0, bottom: HEIGHT - 50.0 };
/// Width at the right for the names of curves, if a plot has curves.
const NAMES_ROOM: f64 = 124.0;
/// Height below the axis break, where zero is.
const ZERO_ROOM: f64 = 40.0;
const MARKER: f64 = 5.5;
/// Longest name, in characters; longer ones are cut. The tooltip and the table have the whole name.
const LONGEST_NAME: usize = 30;
/// Longest name of a curve, in characters, so that it fits [`NAMES_ROOM`].
const LONGEST_CURVE_NAME: usize = 17;

/// A logarithmic axis. Zero, if it occurs, has its own place below a break.
pub(super) struct Axis {
    /// The quantity and its unit.
    pub name: &'static str,
    /// Formats a number at a tick.
    pub tick: fn(f64) -> String,
    low: f64,
    high: f64,
    zero: bool,
}

impl Axis {
    /// Creates an axis that contains all `values`, which must be finite and not negative.
    pub fn over(name: &'static str, tick: fn(f64) -> String, values: impl Iterator<Item = f64> + Clone) -> Self {
        let zero = values.clone().any(|value| value <= 0.0);
        let powers = values.filter(|value| *value > 0.0).map(f64::log10);
        let (low, high) = powers.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        // If all values are zero, some range must still be shown.
        let (low, high) = if low <= high { (low, high) } else { (-8.0, -6.0) };
        // The axis spans at least a factor of four. With less, noise would look like a difference,
        // and there would be too few round numbers.
        let margin = (0.08 * (high - low)).max(0.3 - (high - low) / 2.0);
        Self { name, tick, low: low - margin, high: high + margin, zero }
    }

    /// Returns the position of a value above the break, from 0 (low end) to 1; `None` for zero.
    fn fraction(&self, value: f64) -> Option<f64> {
        (value > 0.0).then(|| (value.log10() - self.low) / (self.high - self.low))
    }

    /// Returns round numbers for the ticks, at least three.
    fn ticks(&self) -> Vec<f64> {
        let decades = (self.low.floor() as i32)..=(self.high.ceil() as i32);
        let ticks = |multiples: &[f64]| -> Vec<f64> {
            let all = decades.clone().flat_map(|power| multiples.iter().map(move |m| m * 10f64.powi(power)));
            all.filter(|value| self.fraction(*value).is_some_and(|f| (-1e-9..=1.0 + 1e-9).contains(&f))).collect()
        };
        let sets: [&[f64]; 3] = [&[1.0], &[1.0, 2.0, 5.0], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]];
        let round = sets.into_iter().map(ticks).find(|found| found.len() >= 3).unwrap_or_default();
        let step = round.len().div_ceil(8).max(1);
        round.into_iter().step_by(step).collect()
    }
}

/// A plot under construction.
pub(super) struct Plot {
    x: Axis,
    y: Axis,
    inside: Area,
    body: String,
    taken: Vec<Area>,
}

impl Plot {
    /// Creates an empty plot of points, with axes and grid.
    pub fn of_points(x: Axis, y: Axis) -> Self {
        Self::new(x, y, INSIDE)
    }

    /// Creates an empty plot of curves, with space for names at their right ends.
    pub fn of_curves(x: Axis, y: Axis) -> Self {
        Self::new(x, y, Area { right: INSIDE.right - NAMES_ROOM, ..INSIDE })
    }

    fn new(x: Axis, y: Axis, inside: Area) -> Self {
        let mut plot = Self { x, y, inside, body: String::new(), taken: Vec::new() };
        let Area { left, top, right, bottom } = inside;
        for value in plot.x.ticks() {
            let (x, label) = (plot.place_x(value), (plot.x.tick)(value));
            plot.add(format_args!(r#"<path class="grid" d="M{x:.1} {top}V{bottom}"/>"#));
            plot.add(format_args!(r#"<text x="{x:.1}" y="{:.1}" text-anchor="middle">{label}</text>"#, bottom + 17.0));
        }
        for value in plot.y.ticks() {
            let (y, label) = (plot.place_y(value), (plot.y.tick)(value));
            plot.add(format_args!(r#"<path class="grid" d="M{left} {y:.1}H{right}"/>"#));
            plot.add(format_args!(
                r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{label}</text>"#,
                left - 7.0,
                y + 4.0
            ));
        }
        if plot.y.zero {
            let (y, pause) = (plot.place_y(0.0), bottom - ZERO_ROOM);
            plot.add(format_args!(r#"<path class="break" d="M{left} {pause}H{right}"/>"#));
            plot.add(format_args!(r#"<text x="{:.1}" y="{:.1}" text-anchor="end">0</text>"#, left - 7.0, y + 4.0));
        }
        plot.add(format_args!(r#"<path class="axes" d="M{left} {top}V{bottom}H{right}"/>"#));
        let (middle, below) = ((left + right) / 2.0, HEIGHT - 10.0);
        let name = escape(plot.x.name);
        plot.add(format_args!(r#"<text x="{middle}" y="{below}" text-anchor="middle">{name}</text>"#));
        let (middle, name) = ((top + bottom) / 2.0, escape(plot.y.name));
        plot.add(format_args!(
            r#"<text transform="translate(14 {middle}) rotate(-90)" text-anchor="middle">{name}</text>"#
        ));
        plot
    }

    fn add(&mut self, what: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = self.body.write_fmt(what);
    }

    fn place_x(&self, value: f64) -> f64 {
        self.inside.left + self.x.fraction(value).unwrap_or(0.0) * (self.inside.right - self.inside.left)
    }

    fn place_y(&self, value: f64) -> f64 {
        let bottom = if self.y.zero { self.inside.bottom - ZERO_ROOM } else { self.inside.bottom };
        let zero = self.inside.bottom - 0.4 * ZERO_ROOM;
        self.y.fraction(value).map_or(zero, |fraction| bottom - fraction * (bottom - self.inside.top))
    }

    fn place(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.place_x(x), self.place_y(y))
    }

    /// Draws a line from point to point.
    pub fn line(&mut self, class: &str, color: &str, points: &[(f64, f64)]) {
        let places: Vec<_> = points.iter().map(|point| self.place(*point)).collect();
        self.path(class, color, &places);
    }

    /// Draws the best error for each time: level until the next point, then down to it.
    ///
    /// `points` must be in order of time. The line starts at the top and continues to the right,
    /// because a longer time is no worse.
    pub fn steps(&mut self, class: &str, color: &str, points: &[(f64, f64)]) {
        let mut places = Vec::new();
        let mut level = self.inside.top;
        for point in points {
            let (x, y) = self.place(*point);
            places.extend([(x, level), (x, y)]);
            level = y;
        }
        places.push((self.inside.right, level));
        self.path(class, color, &places);
    }

    fn path(&mut self, class: &str, color: &str, places: &[(f64, f64)]) {
        let points: Vec<String> = places.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        self.add(format_args!(r#"<polyline class="{class}" stroke="{color}" points="{}"/>"#, points.join(" ")));
        for pair in places.windows(2) {
            let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
            let pieces = ((x1 - x0).hypot(y1 - y0) / 4.0).ceil().max(1.0);
            let along = (0..=pieces as u32).map(|piece| f64::from(piece) / pieces);
            self.taken.extend(along.map(|t| Area::around(x0 + t * (x1 - x0), y0 + t * (y1 - y0), 1.0)));
        }
    }

    /// Draws a labelled horizontal line at a value of the y axis.
    pub fn level(&mut self, name: &str, value: f64) {
        let y = self.place_y(value);
        if (self.inside.top..=self.inside.bottom).contains(&y) {
            let Area { left, right, .. } = self.inside;
            self.add(format_args!(r#"<path class="limit" d="M{left} {y:.1}H{right}"/>"#));
            let (x, above) = (right - 2.0, y - 4.0);
            self.add(format_args!(
                r#"<text class="name" x="{x}" y="{above:.1}" text-anchor="end">{}</text>"#,
                escape(name)
            ));
            let width = 6.0 * name.chars().count() as f64;
            self.taken.push(Area { left: right - width, top: above - 11.0, right, bottom: y + 1.0 });
            self.taken.push(Area { left, top: y - 0.5, right, bottom: y + 0.5 });
        }
    }

    /// Draws a marker; `tip` is its tooltip.
    pub fn marker(&mut self, point: (f64, f64), style: Style, tip: &str) {
        let (x, y) = self.place(point);
        let (corners, color) = (style.marker(x, y, MARKER), style.color);
        let tip = escape(tip);
        self.add(format_args!(
            r#"<polygon class="point" points="{corners}" fill="{color}"><title>{tip}</title></polygon>"#
        ));
        self.taken.push(Area::around(x, y, MARKER + 1.0));
    }

    /// Draws a name at a point. Names avoid everything that was drawn before them.
    pub fn name(&mut self, point: (f64, f64), name: &str) {
        let of_curve = self.inside.right < INSIDE.right;
        let longest = if of_curve { LONGEST_CURVE_NAME } else { LONGEST_NAME };
        let mut text: String = name.chars().take(longest).collect();
        if text.len() < name.len() {
            text.push('…');
        }
        let (x, y) = self.place(point);
        // The name of a curve stands to the right of its end, where there are no curves.
        let bounds = if of_curve { Area { left: x, ..INSIDE } } else { INSIDE };
        let (area, joined) = labels::place(text.chars().count(), (x, y), &bounds, &self.taken);
        let middle = (area.left + area.right) / 2.0;
        // The text is anchored on the side of its point, so that it stays near the point if its
        // font is narrower.
        let (anchor, at) = if area.left >= x {
            ("start", area.left)
        } else if area.right <= x {
            ("end", area.right)
        } else {
            ("middle", middle)
        };
        if joined {
            let (to_x, to_y) = (x.clamp(area.left, area.right), y.clamp(area.top + 2.0, area.bottom - 2.0));
            self.add(format_args!(r#"<path class="leader" d="M{x:.1} {y:.1}L{to_x:.1} {to_y:.1}"/>"#));
        }
        let (base, text) = (area.bottom - 3.0, escape(&text));
        self.add(format_args!(r#"<text class="name" x="{at:.1}" y="{base:.1}" text-anchor="{anchor}">{text}</text>"#));
        self.taken.push(area);
    }

    /// Returns the finished SVG. `id` must be unique on the page; `title` names the plot and
    /// `description` says what it shows.
    pub fn finish(self, class: &str, id: &str, title: &str, description: &str) -> String {
        let (title, description) = (escape(title), escape(description));
        format!(
            "<svg class=\"plot {class}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" \
             aria-labelledby=\"{id}-title {id}-desc\"><title id=\"{id}-title\">{title}</title>\
             <desc id=\"{id}-desc\">{description}</desc>{}</svg>",
            self.body
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::text::tick;

    fn axis(values: &[f64]) -> Axis {
        Axis::over("error", tick, values.iter().copied())
    }

    #[test]
    fn ticks_are_round_and_within_the_axis() {
        assert_eq!(axis(&[1e-8, 1e-3]).ticks().len(), 6);
        assert_eq!(axis(&[2.0, 30.0]).ticks(), [2.0, 5.0, 10.0, 20.0]);
        for values in [[1.0, 1.0], [1.05, 1.06], [3.0, 5.0], [1e-30, 1e30], [9e-9, 1.1e-8]] {
            let ticks = axis(&values).ticks();
            assert!((3..=10).contains(&ticks.len()), "{values:?}: {ticks:?}");
        }
    }

    #[test]
    fn zero_has_a_floor_of_its_own_below_all_others() {
        let plot = Plot::of_points(axis(&[1.0, 10.0]), axis(&[0.0, 1e-7, 1e-3]));
        assert!(plot.place_y(0.0) > plot.place_y(1e-7) + 20.0);
        assert!(plot.place_y(0.0) < INSIDE.bottom);
        assert!(plot.body.contains(">0</text>") && plot.body.contains(r#"class="break""#));
        let plot = Plot::of_points(axis(&[1.0]), axis(&[0.0, 0.0]));
        assert!(plot.place_y(0.0).is_finite());
        assert!(!Plot::of_points(axis(&[1.0]), axis(&[1e-7])).body.contains("break"));
    }
}
