//! The first lines of a table: the separator, the names of the columns, and where the rows start.

use super::cells::{Separator, content, has_decimal_comma, no_number, number};
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

/// The meaning of the first lines of a table.
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

/// The lines in front of the rows.
#[derive(Debug, Default)]
struct Front {
    /// The first line that is no comment, if it has names.
    header: Option<Header>,
    /// The last comment that has names.
    comment: Option<Header>,
    /// The number of points.
    promised: Option<u64>,
}

impl Head {
    /// Finds the columns from the first block of a text.
    ///
    /// # Errors
    ///
    /// [`Fault::Malformed`] with the number of the line that is neither a header nor a row.
    pub(super) fn of(block: &[u8], line_end: u8) -> Result<Self, Fault> {
        let (mut front, mut offset, mut lines) = (Front::default(), 0, 0);
        for line in block.split_inclusive(|byte| *byte == line_end) {
            if let Some(own) = content(line) {
                if !front.take(own, lines + 1).map_err(in_line(lines + 1))? {
                    break;
                }
            } else if let Some(names) = comment_of(line).and_then(names_in) {
                front.comment = Some((lines + 1, names));
            }
            offset += line.len();
            lines += 1;
        }
        front.head((&block[offset..], line_end), (offset, lines))
    }
}

impl Front {
    /// Takes a line that is no comment; returns false if it is the first row.
    fn take(&mut self, line: &[u8], number: u64) -> Result<bool, Fault> {
        let separator = Separator::of(line)?;
        let numbers = separator.cells(line).map(self::number);
        let is_row = numbers.clone().all(|number| number.is_some());
        let count = numbers.clone().flatten().next().filter(|count| *count >= 0.0 && count.fract() == 0.0);
        match (is_row, count) {
            (true, Some(count)) if numbers.clone().count() == 1 && self.promised.is_none() => {
                // The cast saturates.
                self.promised = Some(count as u64);
                Ok(true)
            }
            (true, _) => Ok(false),
            _ if self.header.is_some() => Ok(false),
            _ => {
                self.header = Some((number, names_in(line).ok_or_else(|| no_table(line, separator))?));
                Ok(true)
            }
        }
    }

    /// Finds the columns from the rows that `text` starts with, which lie behind `start` bytes and
    /// lines.
    fn head(self, (text, line_end): (&[u8], u8), start: (usize, u64)) -> Result<Head, Fault> {
        let Self { header, comment, promised } = self;
        let (mut rows, mut length): (Vec<Vec<Option<f64>>>, usize) = (Vec::new(), 0);
        let mut separator = None;
        for (line, own) in (start.1 + 1..).zip(text.split_inclusive(|byte| *byte == line_end)) {
            length += own.len();
            let Some(own) = content(own) else { continue };
            let separator = match separator {
                Some(known) => known,
                None => *separator.insert(Separator::of(own).map_err(in_line(line))?),
            };
            let mut cells: Vec<_> = separator.cells(own).map(number).collect();
            let wanted = rows.first().map(Vec::len).or(header.as_ref().map(|(_, names)| names.len()));
            if wanted == Some(cells.len() + 1) && separator.ends_empty(own) {
                cells.push(Some(f64::NAN));
            }
            if rows.is_empty() {
                check_count(cells.len(), header.as_ref()).map_err(in_line(line))?;
            }
            // Rows of other lengths are refused where they are read.
            if rows.len() == SAMPLE || rows.first().is_some_and(|first| first.len() != cells.len()) {
                break;
            }
            rows.push(cells);
        }
        let count = rows.first().map_or(3, Vec::len);
        let named = header.or(comment.filter(|(_, names)| names.len() == count || rows.is_empty()));
        let is_guess = named.is_none() && count > 3;
        let values = |row: &Vec<Option<f64>>| row.iter().map(|cell| cell.unwrap_or(f64::NAN)).collect();
        let guessed = || guess::names(&rows.iter().map(values).collect::<Vec<_>>());
        let names = named.map_or_else(guessed, |(_, names)| names);
        let is_text = |(column, name): (usize, &String)| {
            let is_axis = ["x", "y", "z"].contains(&name.as_str());
            !is_axis && !rows.is_empty() && rows.iter().all(|row| row[column].is_none())
        };
        let is_text = names.iter().enumerate().map(is_text).collect();
        let row_length = (length / rows.len().max(1)) as u64;
        let separator = separator.unwrap_or(Separator::Space);
        Ok(Head { separator, names, is_guess, is_text, promised, start, row_length })
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
    if let Some(cell) = separator.cells(line).find(|cell| has_decimal_comma(cell)) {
        return no_number(cell);
    }
    let line = shown(line.trim_ascii());
    Fault::Malformed(format!("it is no row of numbers, and names no columns x, y and z: '{line}'"))
}
