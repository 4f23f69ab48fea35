//! Formats names and numbers for HTML and SVG.

/// Shown in place of a missing value.
pub(super) const NONE: &str = "–";

/// Escapes text for use between tags or inside an attribute of HTML, SVG or XML. Characters that
/// XML cannot contain are left out.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '\t' | '\n' | '\r' => escaped.push(character),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => {}
            c => escaped.push(c),
        }
    }
    escaped
}

/// Formats a number with `digits` significant digits, with a power of ten if it is very small or
/// very large.
pub(super) fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return if value > 0.0 { "∞".to_owned() } else { NONE.to_owned() };
    }
    let places = digits.saturating_sub(1);
    // Rounding may carry into the next power of ten, so the power is taken from the rounded number.
    let scientific = format!("{value:.places$e}");
    let power: i32 = scientific.rsplit('e').next().and_then(|power| power.parse().ok()).unwrap_or(0);
    if (-3..6).contains(&power) {
        let decimals = usize::try_from(places as i32 - power).unwrap_or(0);
        grouped(&format!("{value:.decimals$}"))
    } else {
        scientific
    }
}

/// Formats a number with `digits` significant digits, or [`NONE`].
pub(super) fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| NONE.to_owned(), |value| significant(value, digits))
}

/// Formats a large number with an SI prefix: `12.3 M`.
pub(super) fn si(value: f64) -> String {
    const PREFIXES: [(f64, &str); 4] = [(1e12, " T"), (1e9, " G"), (1e6, " M"), (1e3, " k")];
    // A value that rounds to 1,000 of a prefix takes the next prefix.
    match PREFIXES.iter().find(|(unit, _)| value.is_finite() && value >= unit * 0.9995) {
        Some((unit, prefix)) => significant(value / unit, 3) + prefix,
        None => significant(value, 3),
    }
}

/// Formats the number at a tick of an axis, as short as possible.
pub(super) fn tick(value: f64) -> String {
    if (1e-3..1e5).contains(&value) {
        grouped(&format!("{}", (value * 1e6).round() / 1e6))
    } else {
        format!("{value:.0e}")
    }
}

/// Formats the number at a tick of an axis of counts.
pub(super) fn tick_count(value: f64) -> String {
    let text = si(value);
    let (number, prefix) = text.split_once(' ').unwrap_or((&text, ""));
    let number = if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number };
    format!("{number} {prefix}").trim_end().to_owned()
}

/// Formats a whole number with commas between groups of three digits.
pub(super) fn count(value: u64) -> String {
    grouped(&value.to_string())
}

/// Inserts a comma before every third digit of the whole part.
fn grouped(number: &str) -> String {
    let (whole, fraction) = number.find('.').map_or((number, ""), |point| number.split_at(point));
    let (sign, whole) = whole.strip_prefix('-').map_or(("", whole), |whole| ("-", whole));
    let mut text = sign.to_owned();
    for (index, digit) in whole.chars().enumerate() {
        if index > 0 && (whole.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text + fraction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escaped_text_opens_no_tag_and_closes_no_attribute() {
        assert_eq!(escape("<b a=\"x\" b='y'>&"), "&lt;b a=&quot;x&quot; b=&#39;y&#39;&gt;&amp;");
        assert_eq!(escape("épsilon\u{0}\u{1b}\n"), "épsilon\n");
    }

    #[test]
    fn numbers_have_as_many_digits_as_asked() {
        let three = |value| significant(value, 3);
        assert_eq!([three(0.0), three(12.34), three(0.00123), three(1234.5)], ["0", "12.3", "0.00123", "1,234"]);
        assert_eq!([three(9.999), three(1.234e-7), three(-0.5), three(f64::NAN)], ["10.0", "1.23e-7", "-0.500", "–"]);
        assert_eq!([si(999.96), si(12_345_678.0), si(4e9), si(12.0)], ["1.00 k", "12.3 M", "4.00 G", "12.0"]);
        assert_eq!([tick(0.05), tick(2000.0), tick(1e-6), tick(2e5)], ["0.05", "2,000", "1e-6", "2e5"]);
        assert_eq!([tick_count(1e6), tick_count(20_000.0), tick_count(50.0)], ["1 M", "20 k", "50"]);
        assert_eq!([count(999), count(1_000), count(1_234_567)], ["999", "1,000", "1,234,567"]);
    }
}
