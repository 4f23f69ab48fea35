//! Text with a point per line: XYZ, TXT, CSV and ASC files, and the PTS and PTX files of scanners.

mod blocks;
mod cells;
mod guess;
mod head;
mod names;
mod ptx;
mod rows;

use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::Path;

use rayon::prelude::*;

use crate::io::about::About;
use crate::io::encoding;
use crate::io::fault::{self, Fault};
use crate::io::input::Local;
use crate::io::ply::Table;
use crate::io::{Format, Input, Points, ReadOptions, Up, Wanted};
use crate::{Progress, Result};
pub(super) use blocks::Blocks;
pub(super) use cells::{Separator, content, no_number, number};
use head::Head;
pub(super) use head::in_line;
use ptx::Scans;
use rows::{Parsed, Shape, located};

/// Reads the points of a text with a point per line.
///
/// - Separators are spaces, tabs, commas or semicolons, found from the first row. Blank lines and
///   comments, which start with `#`, `//` or `%`, are skipped; a comment may follow the numbers of
///   a row. Text may be in UTF-8 or UTF-16.
/// - A first line with the names x, y and z, also as a comment, names the columns: attributes have
///   the names that PLY vertices have, and other columns of numbers can be asked for by their
///   names. An empty cell, or `NA`, is a number that is missing.
/// - The comments of COLMAP's `points3D.txt` name its columns; its tracks are not read.
/// - Without names, columns are taken as x, y, z, and what their number and their values suggest;
///   [`Points::notes`] says so.
/// - A first line of one number, as in PTS files, is the number of points.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) if the system cannot read,
/// [`Error::Malformed`](crate::Error::Malformed) if the first lines are no table, if a row has
/// another number of columns, or if a cell that is needed is not a number.
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let points = read_with(input, "text", table, (options, progress))?;
    Ok(points)
}

/// Reads the points of a PTS file: as [`read`], where lines of one number say how many points
/// follow. Up is z.
///
/// # Errors
///
/// As [`read`]. In a strict run, also if the file has fewer points than these lines promise.
pub fn read_pts(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let points = read_with(input, "PTS", table, (options, progress))?;
    Ok(Points { up: Some(Up::Z), ..points })
}

/// Reads the points of all scans of a PTX file, in the file's coordinate system. Points at 0 0 0
/// are missing returns and left out. Up is z.
///
/// # Errors
///
/// As [`read`], and if a line does not fit its place in a scan. In a strict run, also if the last
/// scan lacks points.
pub fn read_ptx(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let points = read_with(input, "PTX", scans, (options, progress))?;
    Ok(Points { up: Some(Up::Z), ..points })
}

/// Whether the file at `path` has an extension of text of any kind, `.txt` or `.csv`, and does not
/// start as a table, with the names of columns or a row. Such files often lie beside point clouds.
pub(crate) fn is_other_text(path: &Path) -> bool {
    /// The bytes that decide.
    const START: u64 = 1 << 16;
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    if !["txt", "csv"].iter().any(|other| extension.eq_ignore_ascii_case(other)) {
        return false;
    }
    let is_table = || -> Result<bool, Fault> {
        let mut start = Vec::new();
        File::open(path)?.take(START).read_to_end(&mut start)?;
        let length = start.len() as u64;
        if Format::of_start(&start).is_some() {
            return Ok(true);
        }
        let mut blocks = Blocks::new(encoding::decoded(Cursor::new(start), length)?.0)?;
        let first = blocks.next()?.unwrap_or_default();
        Head::of(&first, blocks.line_end, false).map(|head| !head.is_empty)
    };
    !is_table().unwrap_or(false)
}

/// A text while it is being read.
struct Text<'a> {
    blocks: Blocks,
    /// Length of the text, bytes.
    length: u64,
    /// The name of the format.
    format: &'static str,
    name: String,
    options: &'a ReadOptions,
    progress: &'a dyn Progress,
}

/// Opens a text, reads it by `rows`, and names the file.
fn read_with(
    input: Input,
    format: &'static str,
    rows: fn(Text<'_>) -> Result<Points, Fault>,
    (options, progress): (&ReadOptions, &dyn Progress),
) -> Result<Points> {
    let Local { file, length, path } = input.local()?;
    let in_file = |fault: Fault| fault.of(&path);
    let decoded = encoding::decoded(BufReader::with_capacity(1 << 18, file), length);
    let (reader, length) = decoded.map_err(Fault::Io).map_err(in_file)?;
    progress.begin(&format!("reading {}", fault::name(&path)), length);
    let opened = Blocks::new(reader);
    let name = fault::name(&path);
    let points = opened.and_then(|blocks| {
        progress.advance(blocks.mark);
        rows(Text { blocks, length, format, name, options, progress })
    });
    progress.end();
    let mut points = points.map_err(in_file)?;
    points.raw.iter_mut().for_each(|raw| raw.name = fault::name(&path));
    Ok(points)
}

/// Reads a table, whose rows all have the same columns.
fn table(mut text: Text<'_>) -> Result<Points, Fault> {
    let mut first = text.blocks.next()?.unwrap_or_default();
    let has_counts = text.format == "PTS";
    let head = Head::of(&first, text.blocks.line_end, has_counts)?;
    let (start, mut lines) = head.start;
    first.drain(..start);
    text.progress.advance(start as u64);
    text.blocks.put_back(first);
    // Columns of words have no part in the table.
    let columns: Vec<usize> = (0..head.names.len()).filter(|column| !head.is_text[*column]).collect();
    let names: Vec<String> = columns.iter().map(|column| head.names[*column].clone()).collect();
    let table = Table::of(names.clone(), text.options)?;
    // Columns that only ranges, filters or colours by attribute need may hold other words.
    let picture = ReadOptions { wanted: Wanted::default(), ..text.options.clone() };
    let is_needed = |table: &Table| {
        let mut is_needed = vec![false; head.names.len()];
        table.needed().iter().for_each(|needed| is_needed[columns[*needed]] = true);
        is_needed
    };
    let (is_read, is_strict) = (is_needed(&table), is_needed(&Table::of(names, &picture)?));
    let Head { separator, is_open, .. } = head;
    let shape = Shape { separator, line_end: text.blocks.line_end, is_read, is_strict, has_counts, is_open };
    let mut rows = table.with_capacity(text.length / head.row_length.max(2) + 1)?;
    let mut promised = head.promised;
    text.each(&shape, |parsed| {
        let (parsed, _) = located(parsed, &mut lines)?;
        promised = promised.map(|promised| promised.saturating_add(parsed.promised));
        rows.extend(&parsed.values);
        Ok(())
    })?;
    let read = rows.len();
    let mut points = rows.finish(false)?;
    if head.is_guess {
        let names = head.names.join(" ");
        points.notes.push(format!("{}: columns are taken as {names}; a first line with names would decide", text.name));
    }
    if let Some(doubt) = head.doubt {
        let what = "a first line with names, such as x y z red green blue, would decide";
        points.notes.push(format!("warning: {}: {doubt}: {what}", text.name));
    }
    if let Some(promised) = promised.filter(|promised| *promised > read) {
        text.lacks(&mut points, format!("it promises {promised} points, and ends after {read}"))?;
    }
    let separated = format!("{}, separated by {}", text.format, shape.separator.name());
    points.about = text.options.describe.then(|| {
        let format = if head.is_guess { format!("{separated}, columns by a guess") } else { separated };
        Box::new(About { format, attributes: table.attributes(), ..About::default() })
    });
    Ok(points)
}

/// Reads the scans of a PTX file.
fn scans(mut text: Text<'_>) -> Result<Points, Fault> {
    let line_end = text.blocks.line_end;
    let (is_read, is_strict) = (Vec::new(), Vec::new());
    let shape = Shape { separator: Separator::Space, line_end, is_read, is_strict, has_counts: false, is_open: false };
    let names = |width: usize| ptx::NAMES[..width].iter().map(|name| (*name).to_owned()).collect();
    let table = Table::of(names(ptx::NAMES.len()), text.options)?;
    let (mut scans, mut lines) = (Scans::default(), 0);
    let mut rows = table.with_capacity(0)?;
    text.each(&shape, |parsed| {
        let (parsed, first) = located(parsed, &mut lines)?;
        let points = scans.take(&parsed).map_err(|(line, fault)| in_line(first + line)(fault))?;
        rows.extend_all(&points);
        Ok(())
    })?;
    let mut points = rows.finish(false)?;
    // Whether scans have intensities and colours is known only now.
    let table = Table::of(names(scans.width()), text.options)?;
    points.raw.iter_mut().for_each(|raw| raw.leave_out_columns([scans.width() > 4, scans.width() > 3]));
    points.spans.retain(|span| !ptx::NAMES[scans.width()..].contains(&span.name.to_ascii_lowercase().as_str()));
    let kept = points.positions.len() as u64;
    points.left_out = ptx::in_file(&points.left_out, std::mem::take(&mut scans.missing), kept);
    if scans.lacks() > 0 {
        let (last, lacks) = (scans.count, scans.lacks());
        text.lacks(&mut points, format!("its scan {last} lacks {lacks} of its points at the end of the file"))?;
    }
    points.about = text.options.describe.then(|| {
        let attributes = table.attributes();
        Box::new(About { format: text.format.into(), scans: Some(scans.count), attributes, ..About::default() })
    });
    Ok(points)
}

impl Text<'_> {
    /// Parses the blocks, several at once, and passes them to `take` in their order.
    fn each(
        &mut self,
        shape: &Shape,
        mut take: impl FnMut(Result<Parsed, (u64, Fault)>) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let together = 2 * rayon::current_num_threads();
        loop {
            let mut blocks = Vec::new();
            while blocks.len() < together
                && let Some(block) = self.blocks.next()?
            {
                blocks.push(block);
            }
            if blocks.is_empty() {
                return Ok(());
            }
            let parsed: Vec<_> = blocks.par_iter().map(|block| shape.parse(block)).collect();
            for (block, parsed) in blocks.iter().zip(parsed) {
                take(parsed)?;
                self.progress.advance(block.len() as u64);
            }
        }
    }

    /// Adds a sentence about points that the file lacks; an error in a strict run.
    fn lacks(&self, points: &mut Points, what: String) -> Result<(), Fault> {
        if self.options.strict {
            return Err(Fault::Malformed(what));
        }
        points.unread.push(format!("{}: {what} (--strict refuses the file)", self.name));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn texts_beside_point_clouds_are_no_tables() {
        let folder = tempfile::tempdir().unwrap();
        let is_other = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            is_other_text(&path)
        };
        assert!(is_other("empty.txt", "") && is_other("note.txt", "# by hand\n\n") && is_other("count.txt", "3\n"));
        assert!(is_other("readme.txt", "tiles\n") && is_other("Report.CSV", "name,value\nwidth,3\n"));
        assert!(!is_other("a.txt", "1 2 3\n") && !is_other("a.csv", "x,y,z\n1,2,3\n"));
        assert!(!is_other("b.txt", "ply\nformat ascii 1.0\n"));
        // Other extensions say that it is a table.
        assert!(!is_other("a.xyz", "tiles\n"));
    }
}
