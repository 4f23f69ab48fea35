//! From PLY bytes to points, in one pass and with one small buffer.

use super::header::{self, Element, Encoding, Header, Kind, Scalar};
use super::vertex::{Layout, Vertices};
use crate::io::Points;
use crate::io::fault::{self, Fault};
use crate::io::values::{parse_number, shown};
use crate::{Progress, Result};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

/// Bytes of rows that are decoded together.
const BLOCK: usize = 1 << 19;
/// A number in text is shorter.
const TOKEN_LIMIT: usize = 1 << 10;

/// Reads the vertices of a PLY file: ASCII, or binary of either byte order.
///
/// - `x y z` of any scalar type become f64 positions.
/// - `nx ny nz` become normals, `radius` (or else `scale`) radii in world units.
/// - `sx sy sz` and `tx ty tz`, all six, become half-axes in world units.
/// - `texture_u texture_v` (also `texcoord_u texcoord_v`, `s t`, `u v`) become texture coordinates.
/// - `red green blue` (also `r g b`, `diffuse_red ...`) with optional `alpha`: `uchar` are 8-bit sRGB codes and stay so;
///   `ushort` are 16-bit sRGB codes and become linear light; `float` and `double` are linear light as they are; other
///   integers are taken for 8-bit codes. Alpha is straight and linear in each case.
///
/// Other properties are skipped, and so are other elements: those before the vertices by their declared shape, those
/// after them without being looked at. Zero vertices are no error here.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) where the system cannot read, [`Error::Malformed`](crate::Error::Malformed) where
/// the header is not PLY's, `x`, `y` or `z` is missing, the file ends before the vertices that its header promises, a
/// number in text is none, or a list has a negative length.
pub fn read(path: &Path, progress: &dyn Progress) -> Result<Points> {
    let in_file = |fault: Fault| fault.of(path);
    let file = File::open(path).map_err(Fault::Io).map_err(in_file)?;
    let length = file.metadata().map_err(Fault::Io).map_err(in_file)?.len();
    let mut reader = BufReader::with_capacity(1 << 16, file);
    let header = header::read(&mut reader).map_err(in_file)?;
    let Some(index) = header.elements.iter().position(|element| element.name == "vertex") else {
        return Err(in_file(Fault::Malformed("its header has no element 'vertex'".into())));
    };
    let (before, vertex) = (&header.elements[..index], &header.elements[index]);
    progress.begin(&format!("reading {}", fault::name(path)), vertex.count);
    let points = match header.encoding {
        Encoding::Ascii => read_ascii(reader, &header, before, vertex, length, progress),
        Encoding::LittleEndian => read_binary::<false>(reader, before, vertex, length, progress),
        Encoding::BigEndian => read_binary::<true>(reader, before, vertex, length, progress),
    };
    progress.end();
    points.map_err(in_file)
}

/// The file ended inside an element.
fn ends_early(element: &Element, rows: u64) -> Fault {
    let rows_of = match element.name.as_str() {
        "vertex" => "vertices".to_owned(),
        name => format!("rows of element '{}'", shown(name.as_bytes())),
    };
    Fault::Malformed(format!("the header promises {} {rows_of}, the file ends after {rows}", element.count))
}

fn negative_list(element: &Element, row: u64) -> Fault {
    let name = shown(element.name.as_bytes());
    Fault::Malformed(format!("row {} of element '{name}' has a list of negative length", row + 1))
}

fn read_binary<const BIG: bool>(
    mut reader: impl BufRead,
    before: &[Element],
    vertex: &Element,
    length: u64,
    progress: &dyn Progress,
) -> Result<Points, Fault> {
    for element in before {
        skip_binary::<BIG>(&mut reader, element)?;
    }
    let layout = Layout::of(vertex)?;
    let possible = length / layout.row_size.max(1) as u64;
    let mut vertices = Vertices::with_capacity(&layout, vertex.count.min(possible))?;
    let has_lists = vertex.properties.iter().any(|property| matches!(property.kind, Kind::List { .. }));
    let block_rows = (BLOCK / layout.row_size).max(1);
    let mut block = vec![0; block_rows * layout.row_size];
    let mut columns = vec![Vec::with_capacity(block_rows); layout.columns.len()];
    while vertices.len() < vertex.count {
        let wanted = (vertex.count - vertices.len()).min(block_rows as u64) as usize;
        let rows = if has_lists {
            compact_rows::<BIG>(&mut reader, vertex, vertices.len(), &mut block, wanted, layout.row_size)?
        } else {
            read_until_end(&mut reader, &mut block[..wanted * layout.row_size])? / layout.row_size
        };
        let decoded = &block[..rows * layout.row_size];
        for (values, column) in columns.iter_mut().zip(&layout.columns) {
            decode::<BIG>(decoded, layout.row_size, column.offset, column.scalar, values);
        }
        vertices.extend(rows, |column, row| columns[column][row]);
        progress.advance(rows as u64);
        if rows < wanted {
            return Err(ends_early(vertex, vertices.len()));
        }
    }
    Ok(vertices.into_points())
}

/// The numbers of one column of a block, in place of what `values` held.
fn decode<const BIG: bool>(block: &[u8], row_size: usize, offset: usize, scalar: Scalar, values: &mut Vec<f64>) {
    fn strided<const N: usize>(block: &[u8], row_size: usize, offset: usize) -> impl Iterator<Item = [u8; N]> {
        block.chunks_exact(row_size).filter_map(move |row| row.get(offset..)?.first_chunk().copied())
    }
    macro_rules! numbers {
        ($type:ty) => {
            values.extend(strided(block, row_size, offset).map(|bytes| {
                f64::from(if BIG { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) })
            }))
        };
    }
    values.clear();
    match scalar {
        Scalar::I8 => numbers!(i8),
        Scalar::U8 => numbers!(u8),
        Scalar::I16 => numbers!(i16),
        Scalar::U16 => numbers!(u16),
        Scalar::I32 => numbers!(i32),
        Scalar::U32 => numbers!(u32),
        Scalar::F32 => numbers!(f32),
        Scalar::F64 => numbers!(f64),
    }
}

/// Fills `block` with the scalar properties of up to `wanted` rows, skipping lists; how many rows were whole.
fn compact_rows<const BIG: bool>(
    reader: &mut impl BufRead,
    element: &Element,
    first: u64,
    block: &mut [u8],
    wanted: usize,
    row_size: usize,
) -> Result<usize, Fault> {
    for (index, row) in block.chunks_exact_mut(row_size).take(wanted).enumerate() {
        let mut rest = row;
        for property in &element.properties {
            let whole = match property.kind {
                Kind::Scalar(scalar) => {
                    let (bytes, after) = rest.split_at_mut(scalar.size());
                    rest = after;
                    read_until_end(reader, bytes)? == bytes.len()
                }
                Kind::List { count, item } => skip_list::<BIG>(reader, element, first + index as u64, count, item)?,
            };
            if !whole {
                return Ok(index);
            }
        }
    }
    Ok(wanted)
}

/// Skips one list; `false` where the file ends in it.
fn skip_list<const BIG: bool>(
    reader: &mut impl BufRead,
    element: &Element,
    row: u64,
    count: Scalar,
    item: Scalar,
) -> Result<bool, Fault> {
    let mut bytes = [0; 4];
    let bytes = &mut bytes[..count.size().min(4)];
    if read_until_end(reader, bytes)? < bytes.len() {
        return Ok(false);
    }
    let mut items = Vec::with_capacity(1);
    decode::<BIG>(bytes, bytes.len(), 0, count, &mut items);
    let items = items.first().copied().unwrap_or(0.0);
    if items < 0.0 {
        return Err(negative_list(element, row));
    }
    let size = items as u64 * item.size() as u64;
    Ok(skip_bytes(reader, size)? == size)
}

fn skip_binary<const BIG: bool>(reader: &mut impl BufRead, element: &Element) -> Result<(), Fault> {
    let row_size = element.properties.iter().try_fold(0u64, |size, property| match property.kind {
        Kind::Scalar(scalar) => Some(size + scalar.size() as u64),
        Kind::List { .. } => None,
    });
    if let Some(row_size) = row_size {
        let size = element.count.saturating_mul(row_size);
        let skipped = skip_bytes(reader, size)?;
        return if skipped < size { Err(ends_early(element, skipped / row_size)) } else { Ok(()) };
    }
    for row in 0..element.count {
        for property in &element.properties {
            let whole = match property.kind {
                Kind::Scalar(scalar) => skip_bytes(reader, scalar.size() as u64)? == scalar.size() as u64,
                Kind::List { count, item } => skip_list::<BIG>(reader, element, row, count, item)?,
            };
            if !whole {
                return Err(ends_early(element, row));
            }
        }
    }
    Ok(())
}

fn skip_bytes(reader: &mut impl BufRead, count: u64) -> io::Result<u64> {
    io::copy(&mut reader.take(count), &mut io::sink())
}

/// Fills `bytes`; fewer only where the file ends.
fn read_until_end(reader: &mut impl Read, bytes: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < bytes.len() {
        match reader.read(&mut bytes[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

fn read_ascii(
    reader: impl BufRead,
    header: &Header,
    before: &[Element],
    vertex: &Element,
    length: u64,
    progress: &dyn Progress,
) -> Result<Points, Fault> {
    let mut tokens = Tokens { reader, line: header.lines + 1, token: Vec::new() };
    for element in before {
        for row in 0..if element.properties.is_empty() { 0 } else { element.count } {
            for property in &element.properties {
                if !tokens.skip(element, row, property.kind)? {
                    return Err(ends_early(element, row));
                }
            }
        }
    }
    let layout = Layout::of(vertex)?;
    // Each number takes a digit and a separator at least.
    let possible = length / (2 * layout.scalars.len().max(1)) as u64;
    let mut vertices = Vertices::with_capacity(&layout, vertex.count.min(possible))?;
    let mut used = vec![None; layout.scalars.len()];
    for (index, column) in layout.columns.iter().enumerate() {
        used[column.slot] = Some(index);
    }
    let mut values = vec![0.0; layout.columns.len()];
    let mut unreported = 0;
    for row in 0..vertex.count {
        let mut slots = used.iter();
        for property in &vertex.properties {
            let column = match property.kind {
                Kind::Scalar(_) => slots.next().copied().flatten(),
                Kind::List { .. } => None,
            };
            let whole = match column {
                Some(column) => tokens.number()?.map(|number| values[column] = number).is_some(),
                None => tokens.skip(vertex, row, property.kind)?,
            };
            if !whole {
                return Err(ends_early(vertex, row));
            }
        }
        vertices.extend(1, |column, _| values[column]);
        unreported += 1;
        if unreported == 1 << 16 {
            progress.advance(unreported);
            unreported = 0;
        }
    }
    progress.advance(unreported);
    Ok(vertices.into_points())
}

/// The words of a text, with the line they are on.
struct Tokens<R> {
    reader: R,
    line: u64,
    token: Vec<u8>,
}

impl<R: BufRead> Tokens<R> {
    /// Moves to the next word; `false` at the end of the file.
    fn advance(&mut self) -> Result<bool, Fault> {
        self.token.clear();
        loop {
            let buffer = match self.reader.fill_buf() {
                Ok(buffer) => buffer,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error.into()),
            };
            if buffer.is_empty() {
                return Ok(!self.token.is_empty());
            }
            let mut start = 0;
            if self.token.is_empty() {
                start = buffer.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(buffer.len());
                self.line += buffer[..start].iter().filter(|&&byte| byte == b'\n').count() as u64;
            }
            let word = &buffer[start..];
            let length = word.iter().position(u8::is_ascii_whitespace);
            let end = start + length.unwrap_or(word.len());
            let room = TOKEN_LIMIT.saturating_sub(self.token.len());
            self.token.extend(buffer[start..end].iter().take(room));
            self.reader.consume(end);
            if length.is_some() && !self.token.is_empty() {
                return Ok(true);
            }
        }
    }

    /// The next number; `None` at the end of the file.
    fn number(&mut self) -> Result<Option<f64>, Fault> {
        if !self.advance()? {
            return Ok(None);
        }
        match parse_number(&self.token) {
            Some(number) => Ok(Some(number)),
            None => Err(Fault::Malformed(format!("line {}: '{}' is not a number", self.line, shown(&self.token)))),
        }
    }

    /// Passes over one property; `false` where the file ends in it.
    fn skip(&mut self, element: &Element, row: u64, kind: Kind) -> Result<bool, Fault> {
        if matches!(kind, Kind::Scalar(_)) {
            return self.advance();
        }
        let Some(items) = self.number()? else { return Ok(false) };
        if items < 0.0 {
            return Err(negative_list(element, row));
        }
        if items.fract() != 0.0 {
            let token = shown(&self.token);
            return Err(Fault::Malformed(format!("line {}: '{token}' is not the length of a list", self.line)));
        }
        for _ in 0..items as u64 {
            if !self.advance()? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}
