//! Parses the rows of a block of lines.

use super::cells::{Separator, content, no_number, number};
use super::head::{columns, in_line};
use crate::io::fault::Fault;

/// The form of rows.
pub(super) struct Shape {
    pub(super) separator: Separator,
    pub(super) line_end: u8,
    /// For each column, whether its numbers are read; empty if rows have any number of columns, all
    /// of which are read.
    pub(super) is_read: Vec<bool>,
    /// For each column, whether a cell that is no number is a fault; in other columns it is NaN.
    pub(super) is_strict: Vec<bool>,
    /// A row of a single number says how many rows follow.
    pub(super) has_counts: bool,
    /// Rows may have more cells than columns, which are not read.
    pub(super) is_open: bool,
}

/// The rows of a block.
#[derive(Debug, Default)]
pub(super) struct Parsed {
    /// The numbers that are read, row by row.
    pub(super) values: Vec<f64>,
    /// The end of each row in `values`, and its line in the block from 0; only for rows of any
    /// number of columns.
    pub(super) ends: Vec<(usize, u64)>,
    /// The number of lines.
    pub(super) lines: u64,
    /// The sum of the counts between rows.
    pub(super) promised: u64,
}

impl Shape {
    /// Parses a block whose first line is number `first` of the file.
    ///
    /// # Errors
    ///
    /// The line within the block (from 0) and the [`Fault::Malformed`] of the first row that has
    /// another number of columns, or a cell that is not a number.
    pub(super) fn parse(&self, block: &[u8]) -> Result<Parsed, (u64, Fault)> {
        let mut parsed = Parsed::default();
        for line in block.split_inclusive(|byte| *byte == self.line_end) {
            if let Some(own) = content(line) {
                self.row(own, &mut parsed).map_err(|fault| (parsed.lines, fault))?;
            }
            parsed.lines += 1;
        }
        Ok(parsed)
    }

    fn row(&self, line: &[u8], parsed: &mut Parsed) -> Result<(), Fault> {
        let (before, mut count) = (parsed.values.len(), 0);
        let is_ragged = self.is_read.is_empty();
        for cell in self.separator.row(line, (!is_ragged).then_some(self.is_read.len())) {
            if self.is_open && count == self.is_read.len() {
                break;
            }
            if is_ragged || self.is_read.get(count).copied().unwrap_or_default() {
                let may_lack = !is_ragged && !self.is_strict.get(count).copied().unwrap_or_default();
                let value = number(cell).or(may_lack.then_some(f64::NAN));
                parsed.values.push(value.ok_or_else(|| no_number(cell))?);
            }
            count += 1;
        }
        if count + 1 == self.is_read.len() && self.separator.ends_empty(line) {
            parsed.values.extend(self.is_read.last().filter(|is_read| **is_read).map(|_| f64::NAN));
            count += 1;
        }
        if is_ragged {
            parsed.ends.push((parsed.values.len(), parsed.lines));
        } else if count != self.is_read.len() {
            if count == 1 && self.has_counts {
                parsed.values.truncate(before);
                let counted = self.separator.cells(line).next().and_then(number).unwrap_or_default();
                parsed.promised = parsed.promised.saturating_add(counted as u64);
                return Ok(());
            }
            return Err(Fault::Malformed(format!("{}, not {} as the rows before", columns(count), self.is_read.len())));
        }
        Ok(())
    }
}

/// Numbers the lines of the blocks of a text, one after the other.
pub(super) fn located(parsed: Result<Parsed, (u64, Fault)>, lines: &mut u64) -> Result<(Parsed, u64), Fault> {
    let first = *lines + 1;
    let parsed = parsed.map_err(|(line, fault)| in_line(first + line)(fault))?;
    *lines += parsed.lines;
    Ok((parsed, first))
}
