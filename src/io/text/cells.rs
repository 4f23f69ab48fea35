//! The cells of a line: numbers and names between separators.

use crate::io::fault::Fault;
use crate::io::values::{parse_number, shown};

/// The marks between the cells of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::io) enum Separator {
    /// Any number of spaces and tabs.
    Space,
    /// One mark; cells may be empty.
    Mark(u8),
}

impl Separator {
    /// Returns the separator of a line, which may be a header.
    ///
    /// # Errors
    ///
    /// [`Fault::Malformed`], without a line number, if commas are decimal points.
    pub(in crate::io) fn of(line: &[u8]) -> Result<Self, Fault> {
        // The marks of a comment behind numbers separate nothing.
        if let Some(before) = before_comment(line) {
            let own = Self::of(before)?;
            if own.cells(before).all(|cell| number(cell).is_some()) {
                return Ok(own);
            }
        }
        if line.contains(&b';') {
            return Ok(Self::Mark(b';'));
        }
        if line.contains(&b',') {
            let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
            let first = words.clone().next().unwrap_or_default();
            if words.clone().count() > 2 && words.all(|word| has_decimal_comma(word) || parse_number(word).is_some()) {
                return Err(no_number(first));
            }
            return Ok(Self::Mark(b','));
        }
        let words = |cell| <[u8]>::split(cell, u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let is_list = |cell| words(cell).count() > 1 && words(cell).all(|word| number(word).is_some());
        let is_tabbed = line.contains(&b'\t') && !line.split(|byte| *byte == b'\t').any(is_list);
        Ok(if is_tabbed { Self::Mark(b'\t') } else { Self::Space })
    }

    /// Whether a line ends with an empty cell, which [`cells`](Self::cells) does not count.
    pub(super) fn ends_empty(self, line: &[u8]) -> bool {
        matches!(self, Self::Mark(mark) if line.last() == Some(&mark))
    }

    /// The cells of a row of numbers, of which there are `wanted`, without a comment behind them.
    /// If their number is not known, a cell that starts as a comment is one.
    pub(super) fn row(self, line: &[u8], wanted: Option<usize>) -> impl Iterator<Item = &[u8]> {
        let (mut count, mut is_over) = (0, false);
        self.cells(line).map_while(move |cell| {
            let may_end = wanted.is_none_or(|wanted| count >= wanted);
            if is_over || may_end && starts_comment(cell) {
                return None;
            }
            count += 1;
            // Cells between marks may have spaces.
            let may_hold = self != Self::Space && wanted.is_none_or(|wanted| count >= wanted);
            let before = may_hold.then(|| before_comment(cell)).flatten();
            let before = before.filter(|before| number(before).is_some());
            is_over = before.is_some();
            Some(before.unwrap_or(cell))
        })
    }

    /// Its name as a part of a sentence.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Space => "spaces",
            Self::Mark(b'\t') => "tabs",
            Self::Mark(b';') => "semicolons",
            Self::Mark(_) => "commas",
        }
    }

    /// The cells of a line, without spaces and quotes around them. An empty cell at the end does
    /// not count.
    pub(in crate::io) fn cells(self, line: &[u8]) -> Cells<'_> {
        Cells { separator: self, rest: Some(line) }
    }
}

/// The remaining cells of a line.
#[derive(Clone)]
pub(in crate::io) struct Cells<'a> {
    separator: Separator,
    rest: Option<&'a [u8]>,
}

impl<'a> Iterator for Cells<'a> {
    type Item = &'a [u8];

    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest?.trim_ascii_start();
        if rest.is_empty() && self.separator != Separator::Mark(b'\t') {
            return None;
        }
        let (cell, after) = match self.separator {
            Separator::Space => match rest.iter().position(u8::is_ascii_whitespace) {
                Some(at) => (&rest[..at], Some(&rest[at..])),
                None => (rest, None),
            },
            // Tabs are white space, so an empty cell between two of them is not trimmed.
            Separator::Mark(b'\t') => marked(self.rest?, b'\t'),
            Separator::Mark(mark) => marked(rest, mark),
        };
        self.rest = after;
        let is_last = after.is_none() && cell.is_empty();
        (!is_last).then(|| unquoted(cell))
    }
}

/// Splits a line at the first mark outside quotes.
fn marked(line: &[u8], mark: u8) -> (&[u8], Option<&[u8]>) {
    let skipped = match line.first() {
        Some(b'"') => line.iter().skip(1).position(|byte| *byte == b'"').map_or(0, |at| at + 2),
        _ => 0,
    };
    match line[skipped..].iter().position(|byte| *byte == mark) {
        Some(at) => (line[..skipped + at].trim_ascii(), Some(&line[skipped + at + 1..])),
        None => (line.trim_ascii(), None),
    }
}

fn unquoted(cell: &[u8]) -> &[u8] {
    let inner = cell.strip_prefix(b"\"").and_then(|cell| cell.strip_suffix(b"\""));
    inner.map_or(cell, <[u8]>::trim_ascii)
}

/// Words that stand for a missing number.
const MISSING: [&[u8]; 5] = [b"", b"null", b"none", b"na", b"n/a"];

/// Parses a number; one that is missing becomes NaN.
pub(in crate::io) fn number(cell: &[u8]) -> Option<f64> {
    parse_number(cell).or_else(|| MISSING.iter().any(|word| cell.eq_ignore_ascii_case(word)).then_some(f64::NAN))
}

/// Whether a cell is a number as some countries write it: `1,5`.
pub(super) fn has_decimal_comma(cell: &[u8]) -> bool {
    let mut parts = cell.split(|byte| *byte == b',');
    let (whole, part) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    let whole = whole.strip_prefix(b"-").unwrap_or(whole);
    let fraction = part.first().is_some_and(u8::is_ascii_digit) && parse_number(part).is_some();
    parts.next().is_none() && fraction && whole.iter().all(u8::is_ascii_digit)
}

/// The fault of a cell that is no number; the caller adds the line.
pub(in crate::io) fn no_number(cell: &[u8]) -> Fault {
    let word = shown(cell);
    Fault::Malformed(match has_decimal_comma(cell) {
        true => format!("'{word}' has a decimal comma: write numbers with a decimal point"),
        false => format!("'{word}' is not a number"),
    })
}

/// Marks with which comments start.
const COMMENTS: [&[u8]; 3] = [b"#", b"//", b"%"];

fn starts_comment(text: &[u8]) -> bool {
    COMMENTS.iter().any(|mark| text.starts_with(mark))
}

/// The text after the mark of a comment.
pub(super) fn comment_of(line: &[u8]) -> Option<&[u8]> {
    let line = line.trim_ascii();
    let text = COMMENTS.iter().find_map(|mark| line.strip_prefix(*mark))?;
    Some(text.trim_ascii_start()).filter(|text| !text.is_empty())
}

/// The text before a comment that follows white space; None without a comment or such a text.
fn before_comment(line: &[u8]) -> Option<&[u8]> {
    let is_start = |at: usize| line[at].is_ascii_whitespace() && starts_comment(&line[at + 1..]);
    let at = (0..line.len()).find(|at| is_start(*at))?;
    Some(line[..at].trim_ascii()).filter(|before| !before.is_empty())
}

/// A content line without comments: None for a blank line and for a comment, which starts with `#`,
/// `//` or `%`.
pub(in crate::io) fn content(line: &[u8]) -> Option<&[u8]> {
    // Tabs at the ends are empty cells.
    let is_blank = |byte: &u8| matches!(byte, b' ' | b'\r' | b'\n');
    let start = line.iter().position(|byte| !is_blank(byte))?;
    let end = line.iter().rposition(|byte| !is_blank(byte))?;
    let line = &line[start..=end];
    (!starts_comment(line) && !line.trim_ascii().is_empty()).then_some(line)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn cells(line: &str) -> Vec<String> {
        let of = Separator::of(line.as_bytes()).unwrap().cells(line.as_bytes());
        of.map(|cell| String::from_utf8_lossy(cell).into_owned()).collect()
    }

    #[test]
    fn lines_are_split_as_programs_write_them() {
        for line in
            ["1 2.5 -3", " 1\t2.5   -3 ", "1,2.5,-3", "1, 2.5, -3,", "1;2.5;-3;", "1\t2.5\t-3\t", "\"1\",\"2.5\",-3"]
        {
            assert_eq!(cells(line), ["1", "2.5", "-3"], "{line:?}");
        }
        assert_eq!(cells("\"X\",\"a, b\",\"Z\""), ["X", "a, b", "Z"]);
        assert_eq!(cells("1,,3"), ["1", "", "3"]);
        assert_eq!(cells("1\t\t3"), ["1", "", "3"]);
        assert_eq!(cells("x\tPoint ID\tz"), ["x", "Point ID", "z"]);
        assert!(cells("").is_empty());
    }

    #[test]
    fn decimal_commas_are_named() {
        for line in ["1,5 2,25 3", "-1,5\t2,5\t0,1"] {
            assert!(Separator::of(line.as_bytes()).is_err(), "{line}");
        }
        // Controls.
        for line in ["1, 2, 3", "1,5,2", "1,2 3,4 x"] {
            assert!(Separator::of(line.as_bytes()).is_ok(), "{line}");
        }
        assert!(has_decimal_comma(b"-1,5e3") && !has_decimal_comma(b"1,") && !has_decimal_comma(b"1,5,2"));
    }

    #[test]
    fn comments_and_blank_lines_have_no_content() {
        for line in ["", "  ", "# 1 2 3", "//X Y Z", "% x y z", " \r", "\t\t"] {
            assert_eq!(content(line.as_bytes()), None, "{line:?}");
        }
        assert_eq!(content(b" 1 2\r"), Some(&b"1 2"[..]));
    }
}
