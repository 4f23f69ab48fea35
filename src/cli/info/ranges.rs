//! The lines of `epsplat info` about the ranges of attributes.

use std::fmt::Write;

use epsplat::io::Span;

use super::shown;

/// The most attributes that are listed: Gaussians have 45 for the coefficients of harmonics alone.
pub(super) const MOST: usize = 24;

/// Writes a line for each attribute with its range.
pub(super) fn write(text: &mut String, attributes: &[Span]) {
    let width = attributes.iter().take(MOST).map(|span| shown(&span.name).chars().count()).max().unwrap_or(0);
    let mut head = "ranges";
    for span in attributes.iter().take(MOST) {
        let range = match span.range {
            Some([low, high]) if low == high => format!("{}", rounded(low)),
            Some([low, high]) => format!("{} to {}", rounded(low), rounded(high)),
            None => "no number".to_owned(),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {head:<9} {:<width$}  {range}", shown(&span.name));
        head = "";
    }
    if let Some(more) = attributes.len().checked_sub(MOST).filter(|more| *more > 0) {
        let _ = writeln!(text, "            and {more} more");
    }
}

/// A number without the noise of its last digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.9e}").parse().unwrap_or(value)
}
