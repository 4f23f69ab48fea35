//! Conversions that several formats share: text, numbers, 16-bit colour codes, finite colours.

use crate::scene::color::srgb_to_linear;
use std::io::{self, BufRead};
use std::sync::LazyLock;

/// The byte order mark with which some editors begin UTF-8 text.
pub(super) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Decodes UTF-8 text, or UTF-16 text if it begins with the byte order mark of UTF-16. The mark is
/// removed. Some editors, and redirections on Windows, write UTF-16.
///
/// # Errors
///
/// `InvalidData` for bytes that are not valid text.
pub(super) fn text_of(bytes: &[u8]) -> io::Result<String> {
    let code: fn([u8; 2]) -> u16 = match *bytes {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ => {
            let text = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
            let text = std::str::from_utf8(text).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))?;
            return Ok(text.to_owned());
        }
    };
    let codes: Vec<u16> = bytes[2..].as_chunks().0.iter().map(|&bytes| code(bytes)).collect();
    String::from_utf16(&codes).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
}

/// Linear light of each 16-bit sRGB code.
pub(super) static SRGB16_TO_LINEAR: LazyLock<Vec<f32>> =
    LazyLock::new(|| (0..=u16::MAX).map(|code| srgb_to_linear(f64::from(code) / 65535.0) as f32).collect());

/// Finds the last byte of line ends, from the first line: `\n` (also for `\r\n`), or `\r` alone, as
/// on old Macintoshes.
pub(super) fn line_end(reader: &mut impl BufRead) -> io::Result<u8> {
    let start = reader.fill_buf()?;
    let first = start.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
    // If nothing follows the `\r`, either byte would do.
    let alone = first.is_some_and(|at| start[at] == b'\r' && start.get(at + 1).is_some_and(|next| *next != b'\n'));
    Ok(if alone { b'\r' } else { b'\n' })
}

/// Parses a number as C's `printf` writes it, including `nan`, `inf` and Microsoft's `-nan(ind)`,
/// `1.#QNAN` and `1.#INF`.
pub(super) fn parse_number(token: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(token).ok()?;
    text.parse().ok().or_else(|| {
        let lower = text.to_ascii_lowercase();
        let unsigned = lower.trim_start_matches(['-', '+']);
        if unsigned.starts_with("nan(") || unsigned.starts_with("1.#qnan") || unsigned.starts_with("1.#ind") {
            Some(f64::NAN)
        } else if unsigned.starts_with("1.#inf") {
            Some(if lower.starts_with('-') { f64::NEG_INFINITY } else { f64::INFINITY })
        } else {
            None
        }
    })
}

/// Converts a colour channel to a finite f32: NaN becomes 0, and values beyond f32 saturate.
pub(super) fn finite(value: f64) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32 }
}

/// A token or a name from a file, shortened and without control characters for a one-line message.
pub(super) fn shown(token: &[u8]) -> String {
    let text: String =
        String::from_utf8_lossy(token).chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if text.chars().count() > 40 { text.chars().take(40).chain("...".chars()).collect() } else { text }
}

/// A parser's message on one line. It may quote the file at any length, so the middle of a long
/// message is removed.
pub(super) fn one_line(message: &str) -> String {
    /// The numbers of characters kept at the start and at the end, where parsers say what they
    /// expected and in which line.
    const KEPT: (usize, usize) = (80, 240);
    let text: Vec<char> = message.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    match (text.get(..KEPT.0), text.len().checked_sub(KEPT.1).and_then(|from| text.get(from..))) {
        (Some(start), Some(end)) if text.len() > KEPT.0 + KEPT.1 => start.iter().chain(&['.'; 3]).chain(end).collect(),
        _ => text.into_iter().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_c_writes_them() {
        assert_eq!(parse_number(b"-1.5e3"), Some(-1500.0));
        assert_eq!(parse_number(b"+2"), Some(2.0));
        assert_eq!(parse_number(b"-1.#INF"), Some(f64::NEG_INFINITY));
        for nan in ["nan", "-nan", "-nan(ind)", "1.#QNAN"] {
            assert!(parse_number(nan.as_bytes()).is_some_and(f64::is_nan), "{nan}");
        }
        for other in ["", "x", "1,5", "0x10", "--1"] {
            assert_eq!(parse_number(other.as_bytes()), None, "{other}");
        }
    }

    #[test]
    fn lines_end_as_the_first_one_does() {
        for (text, end) in [("", b'\n'), ("a", b'\n'), ("a\nb\rc", b'\n'), ("a\r\nb", b'\n'), ("a\rb\nc", b'\r')] {
            assert_eq!(line_end(&mut text.as_bytes()).ok(), Some(end), "{text:?}");
        }
    }

    #[test]
    fn messages_are_one_short_line() {
        assert_eq!(one_line("unknown field `a\nb\u{85}`"), "unknown field `a\u{fffd}b\u{fffd}`");
        let whole = "é".repeat(320);
        assert_eq!(one_line(&whole), whole);
        let cut = one_line(&format!("begin{whole}end"));
        assert!(cut.starts_with("beginé") && cut.contains("é...é") && cut.ends_with("éend"), "{cut}");
        assert_eq!(cut.chars().count(), 323);
    }

    #[test]
    fn colour_channels_stay_finite() {
        assert_eq!(finite(f64::NAN), 0.0);
        assert_eq!(finite(f64::INFINITY), f32::MAX);
        assert_eq!(finite(-1e300), f32::MIN);
        assert_eq!(finite(0.25), 0.25);
    }
}
