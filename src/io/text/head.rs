//! The first lines of a table: the separator, the names of the columns, and where the rows start.

use super::cells::{Separator, comment_of, content, has_decimal_comma, no_number, number};
use super::guess::{self, Guess, Sample};
use super::names::names_in;
use crate::io::fault::Fault;
use crate::io::values::shown;

/// The rows from whose values columns are guessed.
const SAMPLE: usize = 1000;

/// The most columns of a table.
pub(super) const MOST_COLUMNS: usize = 256;

/// The meaning of the first lines of a table.
#[derive(Debug)]
pub(super) struct Head {
    pub(super) separator: Separator,
    /// The names of all columns; those of coordinates are `x`, `y` and `z`.
    pub(super) names: Vec<String>,
    /// Whether the names are a guess.
    pub(super) is_guess: bool,
    /// A reason why the guess may be wrong, as a clause.
    pub(super) doubt: Option<String>,
    /// There is neither a row nor a name of a column.
    pub(super) is_empty: bool,
    /// Rows have more cells than columns, in any number.
    pub(super) is_open: bool,
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
    /// The names are those of COLMAP's `points3D.txt`, whose rows end with a track.
    is_open: bool,
}

impl Head {
    /// Finds the columns from the first block of a text. In a `pts` file, intensities precede
    /// colours.
    ///
    /// # Errors
    ///
    /// [`Fault::Malformed`] with the number of the line that is neither a header nor a row.
    pub(super) fn of(block: &[u8], line_end: u8, is_pts: bool) -> Result<Self, Fault> {
        let (mut front, mut offset, mut lines) = (Front::default(), 0, 0);
        for line in block.split_inclusive(|byte| *byte == line_end) {
            if let Some(own) = content(line) {
                if !front.take(own, lines + 1).map_err(in_line(lines + 1))? {
                    break;
                }
            } else if let Some(names) = comment_of(line).and_then(names_in).filter(|_| !front.is_open) {
                let has_track = names.get(TRACKED.len()).is_some_and(|name| name.starts_with("TRACK"));
                front.is_open = has_track && names[0] == TRACKED[0];
                let names = if front.is_open { TRACKED.map(str::to_owned).to_vec() } else { names };
                front.comment = Some((lines + 1, names));
            }
            offset += line.len();
            lines += 1;
        }
        front.head((&block[offset..], line_end), (offset, lines), is_pts)
    }
}

/// The columns of COLMAP's `points3D.txt`, after which each row has a track of any length.
const TRACKED: [&str; 8] = ["POINT3D_ID", "x", "y", "z", "R", "G", "B", "ERROR"];

impl Front {
    /// Takes a line that is no comment; returns false if it is the first row.
    fn take(&mut self, line: &[u8], number: u64) -> Result<bool, Fault> {
        let separator = Separator::of(line)?;
        let numbers: Vec<Option<f64>> = separator.row(line, None).map(self::number).collect();
        let is_row = numbers.iter().all(Option::is_some);
        let count = numbers.iter().flatten().next().filter(|count| **count >= 0.0 && count.fract() == 0.0);
        match (is_row, count) {
            (true, Some(count)) if numbers.len() == 1 && self.promised.is_none() => {
                // The cast saturates.
                self.promised = Some(*count as u64);
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
    fn head(self, text: (&[u8], u8), start: (usize, u64), is_pts: bool) -> Result<Head, Fault> {
        let Rows { rows, separator, mut sample, length } = self.rows(text, start.1)?;
        let Self { header, comment, promised, is_open } = self;
        let count = rows.first().map_or(3, Vec::len);
        let named = header.or(comment.filter(|(_, names)| names.len() == count || rows.is_empty()));
        let is_empty = named.is_none() && rows.is_empty();
        let is_guess = named.is_none() && count > 3;
        let values = |row: &Vec<Option<f64>>| row.iter().map(|cell| cell.unwrap_or(f64::NAN)).collect();
        sample.rows = rows.iter().map(values).collect();
        (sample.is_pts, sample.is_counted) = (is_pts, promised.is_some());
        let Guess { names, doubt } = match named {
            Some((_, names)) => Guess { names, doubt: None },
            None => guess::names(&sample),
        };
        let is_text = |(column, name): (usize, &String)| {
            let is_axis = ["x", "y", "z"].contains(&name.as_str());
            !is_axis && !rows.is_empty() && rows.iter().all(|row| row[column].is_none())
        };
        let is_text = names.iter().enumerate().map(is_text).collect();
        let row_length = (length / rows.len().max(1)) as u64;
        Ok(Head { separator, names, is_guess, doubt, is_empty, is_open, is_text, promised, start, row_length })
    }

    /// Reads the first rows of a text with this end of lines, behind `before` lines.
    fn rows(&self, (text, line_end): (&[u8], u8), before: u64) -> Result<Rows, Fault> {
        let (mut rows, mut length): (Vec<Vec<Option<f64>>>, usize) = (Vec::new(), 0);
        let (mut separator, mut sample) = (None, Sample::default());
        let tracked = self.comment.as_ref().filter(|_| self.is_open);
        let header = self.header.as_ref().or(tracked);
        for (line, own) in (before + 1..).zip(text.split_inclusive(|byte| *byte == line_end)) {
            length += own.len();
            let Some(own) = content(own) else { continue };
            let separator = match separator {
                Some(known) => known,
                None => *separator.insert(Separator::of(own).map_err(in_line(line))?),
            };
            let wanted = rows.first().map(Vec::len).or(header.map(|(_, names)| names.len()));
            let most = wanted.filter(|_| self.is_open).unwrap_or(usize::MAX);
            let words: Vec<&[u8]> = separator.row(own, wanted).take(most).collect();
            let mut cells: Vec<_> = words.iter().map(|word| number(word)).collect();
            if wanted == Some(cells.len() + 1) && separator.ends_empty(own) {
                cells.push(Some(f64::NAN));
            }
            if rows.is_empty() {
                check_count(cells.len(), header).map_err(in_line(line))?;
            }
            // Rows of other lengths are refused where they are read.
            if rows.len() == SAMPLE || rows.first().is_some_and(|first| first.len() != cells.len()) {
                break;
            }
            sample.fractional.resize(cells.len(), false);
            let has_point = |word: &&[u8]| word.iter().any(|byte| matches!(byte, b'.' | b'e' | b'E'));
            sample.fractional.iter_mut().zip(&words).for_each(|(is, word)| *is |= has_point(word));
            rows.push(cells);
        }
        Ok(Rows { rows, separator: separator.unwrap_or(Separator::Space), sample, length })
    }
}

/// The first rows of a text.
struct Rows {
    /// Their numbers; None for words.
    rows: Vec<Vec<Option<f64>>>,
    separator: Separator,
    /// The forms of their numbers.
    sample: Sample,
    /// The bytes of their lines.
    length: usize,
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

/// The fault of a first line that is neither a row nor a header.
fn no_table(line: &[u8], separator: Separator) -> Fault {
    if let Some(cell) = separator.cells(line).find(|cell| has_decimal_comma(cell)) {
        return no_number(cell);
    }
    let line = shown(line.trim_ascii());
    Fault::Malformed(format!("it is no row of numbers, and names no columns x, y and z: '{line}'"))
}
