//! The points of a PCD file in its three encodings.

use std::io::{self, BufRead, Read};

use super::header::{Field, Header, Scalar};
use super::lzf;
use super::points::{Cell, Columns, Place, Reading};
use crate::Progress;
use crate::io::Points;
use crate::io::fault::{Fault, reserve};
use crate::io::values::{parse_number, shown};

/// The size in bytes of the blocks that are decoded at once.
const BLOCK: u64 = 1 << 19;

/// The longest line of text, in bytes.
const LINE_LIMIT: u64 = 1 << 24;

fn ends_early(header: &Header, rows: u64) -> Fault {
    Fault::Malformed(format!("the header promises {} points, the file ends after {rows}", header.points))
}

/// Reads `ascii` data: a point per line, with its numbers separated by white space.
///
/// Here and below, `left` is the number of bytes after the header.
pub(super) fn ascii(
    mut reader: impl BufRead,
    (header, columns): (&Header, Columns),
    left: u64,
    progress: &dyn Progress,
) -> Result<Points, Fault> {
    let cells = columns.cells.iter().enumerate();
    let mut wanted: Vec<_> =
        cells.map(|(index, cell)| (cell.field, cell.part, index, columns.is_packed(index))).collect();
    wanted.sort_unstable();
    // A point takes at least two bytes, a digit and a separator, which limits the memory to
    // reserve.
    let plain = columns.plain;
    let mut values = vec![0.0; columns.cells.len()];
    let mut reading = Reading::with_capacity(columns, header, header.points.min(left / 2))?;
    let (mut line, mut number, mut unreported) = (Vec::new(), header.lines, 0);
    while reading.len() < header.points {
        line.clear();
        number += 1;
        let bytes = reader.by_ref().take(LINE_LIMIT).read_until(header.line_end, &mut line)?;
        if bytes == 0 {
            return Err(ends_early(header, reading.len()));
        }
        if bytes as u64 == LINE_LIMIT {
            return Err(Fault::Malformed(format!("line {number} is longer than {LINE_LIMIT} bytes")));
        }
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).peekable();
        if words.peek().is_none() {
            continue;
        }
        let mut wanted = wanted.iter().peekable();
        for (index, field) in header.fields.iter().enumerate() {
            for part in 0..field.count {
                let word = words.next().ok_or_else(|| too_few(number))?;
                while let Some((_, _, cell, packed)) = wanted.next_if(|(f, p, ..)| (*f, *p) == (index, part)) {
                    let value = if *packed { packed_color(word, field.scalar) } else { parse_number(word) };
                    // Words that only options ask for are no fault of the file.
                    let value = value.or((*cell >= plain).then_some(f64::NAN));
                    values[*cell] = value
                        .ok_or_else(|| Fault::Malformed(format!("line {number}: '{}' is not a number", shown(word))))?;
                }
            }
        }
        reading.extend(1, |cell, _| values[cell]);
        unreported += 1;
        if unreported == 1 << 16 {
            progress.advance(std::mem::take(&mut unreported));
        }
    }
    progress.advance(unreported);
    reading.into_points()
}

fn too_few(line: u64) -> Fault {
    Fault::Malformed(format!("line {line}: it has fewer numbers than the header has fields"))
}

/// Parses a packed colour that is written as a number of the given type; returns its bits.
fn packed_color(word: &[u8], scalar: Scalar) -> Option<f64> {
    let text = std::str::from_utf8(word).ok()?;
    let bits = match scalar {
        // Some programs write the bits as an integer although the type is F.
        Scalar::Float if text.bytes().all(|byte| byte.is_ascii_digit()) => text.parse().ok()?,
        Scalar::Float => {
            text.parse::<i32>().map(i32::cast_unsigned).or_else(|_| text.parse().map(f32::to_bits)).ok()?
        }
        Scalar::Unsigned => text.parse().ok()?,
        Scalar::Signed => text.parse::<i32>().ok()?.cast_unsigned(),
    };
    Some(bits.into())
}

/// Reads `binary` data: one point after the other.
pub(super) fn binary(
    mut reader: impl Read,
    (header, columns): (&Header, Columns),
    left: u64,
    progress: &dyn Progress,
) -> Result<Points, Fault> {
    let held = left / header.row;
    if held < header.points {
        return Err(ends_early(header, held));
    }
    let mut places = Vec::new();
    let mut start = 0;
    for field in &header.fields {
        places.push(Place { start, stride: header.row as usize });
        start += (field.size * field.count) as usize;
    }
    let cells = Cells::of(header, &columns, &places);
    let mut reading = Reading::with_capacity(columns, header, header.points)?;
    let rows = (BLOCK / header.row).max(1);
    let mut block = Vec::new();
    reserve(&mut block, rows.min(header.points) * header.row)?;
    while reading.len() < header.points {
        let rows = rows.min(header.points - reading.len());
        block.clear();
        let size = rows * header.row;
        if reader.by_ref().take(size).read_to_end(&mut block)? < size as usize {
            return Err(ends_early(header, reading.len() + block.len() as u64 / header.row));
        }
        cells.extend(&mut reading, &block, rows as usize);
        progress.advance(rows);
    }
    reading.into_points()
}

/// Reads `binary_compressed` data.
///
/// Two u32 give the compressed and the decompressed length. The decompressed data has the first
/// field of all points, then the second of all, and so on.
pub(super) fn compressed(
    mut reader: impl Read,
    (header, columns): (&Header, Columns),
    left: u64,
    progress: &dyn Progress,
) -> Result<Points, Fault> {
    if header.points == 0 {
        return Reading::with_capacity(columns, header, 0)?.into_points();
    }
    let mut lengths = [[0; 4]; 2];
    for length in &mut lengths {
        reader.read_exact(length).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => ends_early(header, 0),
            _ => Fault::Io(error),
        })?;
    }
    let [packed_length, length] = lengths.map(|bytes| u64::from(u32::from_le_bytes(bytes)));
    if header.points.checked_mul(header.row) != Some(length) {
        let points = header.points;
        return Err(Fault::Malformed(format!(
            "the header promises {points} points, but the data of {length} bytes does not fit them"
        )));
    }
    if packed_length > left.saturating_sub(8) {
        return Err(ends_early(header, 0));
    }
    let undecodable = || Fault::Malformed("its compressed data cannot be decoded; the file is damaged".into());
    if length > packed_length.saturating_mul(lzf::MOST_GROWTH) {
        return Err(undecodable());
    }
    let mut packed = Vec::new();
    reserve(&mut packed, packed_length)?;
    reader.by_ref().take(packed_length).read_to_end(&mut packed)?;
    let bytes = lzf::unpack(&packed, length as usize).ok_or_else(undecodable)?;
    drop(packed);
    let mut places = Vec::new();
    let mut start = 0;
    for field in &header.fields {
        let stride = (field.size * field.count) as usize;
        places.push(Place { start, stride });
        start += stride * header.points as usize;
    }
    let cells = Cells::of(header, &columns, &places);
    let mut reading = Reading::with_capacity(columns, header, header.points)?;
    cells.extend(&mut reading, &bytes, header.points as usize);
    progress.advance(header.points);
    reading.into_points()
}

/// For each [`Cell`] its field, the place of its numbers in the data, and whether the cell is a
/// packed colour.
struct Cells<'a>(Vec<(&'a Field, Place, bool)>);

impl<'a> Cells<'a> {
    /// The cells of `columns`, in data where the fields lie at `places`.
    fn of(header: &'a Header, columns: &Columns, places: &[Place]) -> Self {
        let of_cell = |(index, cell): (usize, &Cell)| {
            let (field, Place { start, stride }) = (&header.fields[cell.field], places[cell.field]);
            let start = start + (field.size * cell.part) as usize;
            (field, Place { start, stride }, columns.is_packed(index))
        };
        Self(columns.cells.iter().enumerate().map(of_cell).collect())
    }

    /// Appends `rows` points.
    fn extend(&self, reading: &mut Reading, bytes: &[u8], rows: usize) {
        reading.extend(rows, |cell, row| {
            let (field, Place { start, stride }, packed) = self.0[cell];
            field.number(bytes, start + row * stride, packed)
        });
    }
}
