//! The first lines of a table: the separator, the names of the columns, and where the rows start.

use super::cells::{Separator, content, no_number, number};
use super::guess;
use crate::io::attributes::find;
use crate::io::fault::Fault;
use crate::io::values::shown;

/// The rows from whose values columns are guessed.
const SAMPLE: usize = 1000;

/// The most columns of a table.
const MOST_COLUMNS: usize = 256;

/// Names of coordinates in headers.
const COORDINATES: [&[&str]; 3] =
    [&["x", "easting", "east"], &["y", "northing", "north"], &["z", "elevation", "height", "altitude"]];

/// What the first lines of a table say.
#[derive(Debug)]
pub(super) struct Head {
    pub(super) separator: Separator,
    /// The names of all columns; those of coordinates are `x`, `y` and `z`.
    pub(super) names: Vec<String>,
    /// Whether the names are a guess.
    pub(super) is_guess: bool,
    /// For each column, whether its cells are words, which are not read.
    pub(super) is_text: Vec<bool>,
    /// The number of points that a line in front of the rows promises.
    pub(super) promised: Option<u64>,
    /// The bytes and lines in front of the first row.
    pub(super) start: (usize, u64),
    /// The mean length of the first rows, bytes.
    pub(super) row_length: u64,
}

/// Adds the number of its line to a fault.
pub(in crate::io) fn in_line(line: u64) -> impl Fn(Fault) -> Fault {
    move |fault| match fault {
        Fault::Malformed(what) => Fault::Malformed(format!("line {line}: {what}")),
        other => other,
    }
}

/// A line of names, and its number.
type Header = (u64, Vec<String>);

impl Head {
    /// Finds the columns from the first block of a text.
    ///
    /// # Errors
    ///
    /// [`Fault::Malformed`] with the number of the line that is neither a header nor a row.
    pub(super) fn of(block: &[u8], line_end: u8) -> Result<Self, Fault> {
        let (mut header, mut comment): (Option<Header>, Option<Header>) = (None, None);
        let (mut promised, mut offset) = (None, 0);
        for (number, line) in (1..).zip(block.split_inclusive(|byte| *byte == line_end)) {
            let at = in_line(number);
            if let Some(own) = content(line) {
                let separator = Separator::of(own).map_err(&at)?;
                let numbers = separator.cells(own).map(self::number);
                if numbers.clone().all(|number| number.is_some()) {
                    match (numbers.clone().count(), numbers.flatten().next()) {
                        (1, Some(count)) if count >= 0.0 && count.fract() == 0.0 && promised.is_none() => {
                            promised = Some(count as u64);
                        }
                        _ => {
                            return Self::with_rows(
                                (&block[offset..], line_end),
                                (offset, number - 1),
                                header,
                                comment,
                                promised,
                            );
                        }
                    }
                } else if header.is_none()
                    && let Some(names) = names_in(own)
                {
                    header = Some((number, names));
                } else if header.is_some() {
                    return Self::with_rows(
                        (&block[offset..], line_end),
                        (offset, number - 1),
                        header,
                        comment,
                        promised,
                    );
                } else {
                    return Err(at(no_table(own, separator)));
                }
            } else if let Some(names) = comment_of(line).and_then(names_in) {
                comment = Some((number, names));
            }
            offset += line.len();
        }
        let names = header.or(comment).map_or_else(|| guess::names(&[vec![0.0; 3]]), |(_, names)| names);
        let is_text = vec![false; names.len()];
        let separator = Separator::Space;
        Ok(Self { separator, names, is_guess: false, is_text, promised, start: (offset, 0), row_length: 1 })
    }

    /// The columns of the rows that `text` starts with, which lie behind `start` bytes and lines.
    fn with_rows(
        (text, line_end): (&[u8], u8),
        start: (usize, u64),
        header: Option<Header>,
        comment: Option<Header>,
        promised: Option<u64>,
    ) -> Result<Self, Fault> {
        let lines = (start.1 + 1..).zip(text.split_inclusive(|byte| *byte == line_end));
        let (mut rows, mut length): (Vec<Vec<Option<f64>>>, usize) = (Vec::new(), 0);
        let mut separator = None;
        for (number, line) in lines {
            length += line.len();
            let Some(own) = content(line) else { continue };
            let separator = match separator {
                Some(known) => known,
                None => *separator.insert(Separator::of(own).map_err(in_line(number))?),
            };
            let cells: Vec<_> = separator.cells(own).map(self::number).collect();
            check_count(cells.len(), header.as_ref()).map_err(in_line(number))?;
            // Rows of other lengths are refused where they are read.
            if rows.len() == SAMPLE || rows.first().is_some_and(|first| first.len() != cells.len()) {
                break;
            }
            rows.push(cells);
        }
        let separator = separator.unwrap_or(Separator::Space);
        let count = rows.first().map_or(0, Vec::len);
        let named = header.or(comment.filter(|(_, names)| names.len() == count)).map(|(_, names)| names);
        let is_guess = named.is_none() && count > 3;
        let values = |row: &Vec<Option<f64>>| row.iter().map(|cell| cell.unwrap_or(f64::NAN)).collect();
        let names = named.unwrap_or_else(|| guess::names(&rows.iter().map(values).collect::<Vec<_>>()));
        let is_text = |(column, name): (usize, &String)| {
            !["x", "y", "z"].contains(&name.as_str()) && rows.iter().all(|row| row[column].is_none())
        };
        let is_text = names.iter().enumerate().map(is_text).collect();
        let row_length = (length / rows.len().max(1)) as u64;
        Ok(Self { separator, names, is_guess, is_text, promised, start, row_length })
    }
}

/// Checks the number of cells of a row.
fn check_count(count: usize, header: Option<&Header>) -> Result<(), Fault> {
    if let Some((line, names)) = header.filter(|(_, names)| names.len() != count) {
        return Err(Fault::Malformed(format!("{}, but line {line} names {}", columns(count), names.len())));
    }
    match count {
        3..=MOST_COLUMNS => Ok(()),
        0..3 => Err(Fault::Malformed(format!("{}: x, y and z are needed", columns(count)))),
        _ => Err(Fault::Malformed(format!("{}, more than {MOST_COLUMNS}", columns(count)))),
    }
}

/// The number of columns of a row as a part of a sentence.
pub(super) fn columns(count: usize) -> String {
    if count == 1 { "it has 1 column".into() } else { format!("it has {count} columns") }
}

/// The text after the mark of a comment.
fn comment_of(line: &[u8]) -> Option<&[u8]> {
    let line = line.trim_ascii();
    let text = line.strip_prefix(b"//").or_else(|| line.strip_prefix(b"#"))?;
    Some(text.trim_ascii_start()).filter(|text| !text.is_empty())
}

/// The names of the columns in a header; None if x, y and z are not among them. Coordinates get the
/// names `x`, `y` and `z`.
fn names_in(line: &[u8]) -> Option<Vec<String>> {
    let separator = Separator::of(line).ok()?;
    let name = |cell: &[u8]| String::from_utf8_lossy(cell).into_owned();
    let mut names: Vec<String> = separator.cells(line).take(MOST_COLUMNS).map(name).collect();
    // A unit may follow the name of a coordinate: `X [m]`.
    let plain: Vec<String> =
        names.iter().map(|name| name.split(['[', '(']).next().unwrap_or_default().trim().to_owned()).collect();
    let places = COORDINATES.map(|known| find(known, plain.iter().map(String::as_str)));
    for (axis, place) in ["x", "y", "z"].into_iter().zip(places) {
        *names.get_mut(place?)? = axis.to_owned();
    }
    Some(names)
}

/// The fault of a first line that is neither a row nor a header.
fn no_table(line: &[u8], separator: Separator) -> Fault {
    let words = separator.cells(line).filter(|cell| number(cell).is_none());
    let first = words.clone().next().unwrap_or_default();
    match no_number(first) {
        Fault::Malformed(what) if words.count() < 2 => Fault::Malformed(what),
        _ => Fault::Malformed(format!(
            "it is no row of numbers, and names no columns x, y and z: '{}'",
            shown(line.trim_ascii())
        )),
    }
}
