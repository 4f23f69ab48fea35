//! Binary PLY: rows are read in blocks, and each block is decoded column by column.

use super::contents::{Contents, ends_early, negative_list};
use super::faces::{Faces, Role, needed};
use super::header::{Element, Header, Kind, Scalar};
use super::vertex::{Layout, Vertices, is_tree};
use super::whole::{self, is_whole};
use crate::Progress;
use crate::io::dimensions::Collector;
use crate::io::fault::Fault;
use crate::io::{Points, Tree, TreeRow};
use std::io::{self, BufRead, Read};

/// Size of a block of rows, or of a part of a list, that is decoded at once, bytes.
const BLOCK: usize = 1 << 19;

/// Reads the needed elements; `reader` must stand just after the header.
pub(super) fn read<const BIG: bool>(
    mut reader: impl BufRead,
    header: &Header,
    length: u64,
    faces: Faces,
    progress: &dyn Progress,
) -> Result<Contents, Fault> {
    let mut contents = Contents { faces, ..Contents::default() };
    for element in needed(&header.elements) {
        if element.name == "vertex" {
            (contents.points, _, contents.collector) = vertices::<BIG>(&mut reader, element, length, progress)?;
        } else if is_tree(element) {
            let (nodes, rows, _) = vertices::<BIG>(&mut reader, element, length, &())?;
            contents.tree = Some(Tree { nodes: Box::new(nodes), rows });
        } else if is_whole(element) && !BIG {
            let mut row = [0; whole::BYTES];
            if read_until_end(&mut reader, &mut row)? < row.len() {
                return Err(ends_early(element, 0));
            }
            contents.whole = Some(whole::parse(&row, 0, 0));
        } else if Faces::are(element) {
            self::faces::<BIG>(&mut reader, element, &mut contents.faces)?;
        } else {
            skip::<BIG>(&mut reader, element)?;
        }
    }
    Ok(contents)
}

/// Reads the rows of an element with positions. Also returns the [`TreeRow`]s if the element is the
/// nodes of levels of detail.
pub(super) fn vertices<const BIG: bool>(
    mut reader: impl BufRead,
    vertex: &Element,
    length: u64,
    progress: &dyn Progress,
) -> Result<(Points, Vec<TreeRow>, Option<Collector>), Fault> {
    let layout = &Layout::of(vertex)?;
    let possible = length / layout.row_size.max(1) as u64;
    let mut decoder = Decoder::new(layout, vertex.count.min(possible))?;
    let has_lists = vertex.properties.iter().any(|property| matches!(property.kind, Kind::List { .. }));
    let block_rows = layout.block_rows().min(usize::try_from(vertex.count).unwrap_or(usize::MAX).max(1));
    let mut block = vec![0; block_rows * layout.row_size];
    while decoder.vertices.len() < vertex.count {
        let wanted = (vertex.count - decoder.vertices.len()).min(block_rows as u64) as usize;
        let rows = if has_lists {
            compact_rows::<BIG>(&mut reader, vertex, decoder.vertices.len(), &mut block, wanted, layout.row_size)?
        } else {
            read_until_end(&mut reader, &mut block[..wanted * layout.row_size])? / layout.row_size
        };
        decoder.take::<BIG>(&block[..rows * layout.row_size]);
        progress.advance(rows as u64);
        if rows < wanted {
            return Err(ends_early(vertex, decoder.vertices.len()));
        }
    }
    Ok(decoder.vertices.into_points())
}

/// Decodes `rows` that are in memory and have no lists, as [`vertices`] does.
pub(super) fn vertices_in<const BIG: bool>(rows: &[u8], layout: &Layout) -> Result<(Points, Vec<TreeRow>), Fault> {
    // Rows that are read in part have no wanted attributes.
    let mut decoder = Decoder::new(layout, (rows.len() / layout.row_size) as u64)?;
    rows.chunks(layout.block_rows() * layout.row_size).for_each(|block| decoder.take::<BIG>(block));
    let (points, rows, _) = decoder.vertices.into_points();
    Ok((points, rows))
}

impl Layout {
    /// Rows in a block; `row_size` is not 0, as every layout has a position.
    fn block_rows(&self) -> usize {
        (BLOCK / self.row_size).max(1)
    }
}

/// Decodes blocks of rows into vertices.
struct Decoder<'a> {
    layout: &'a Layout,
    vertices: Vertices<'a>,
    /// The numbers of the current block, one vector for each column of the layout.
    columns: Vec<Vec<f64>>,
}

impl<'a> Decoder<'a> {
    fn new(layout: &'a Layout, rows: u64) -> Result<Self, Fault> {
        let vertices = Vertices::with_capacity(layout, rows)?;
        Ok(Self { layout, vertices, columns: vec![Vec::new(); layout.columns.len()] })
    }

    /// Decodes and adds a block of whole rows.
    fn take<const BIG: bool>(&mut self, block: &[u8]) {
        let Self { layout, vertices, columns } = self;
        for (values, column) in columns.iter_mut().zip(&layout.columns) {
            decode::<BIG>(block, layout.row_size, column.offset, column.scalar, values);
        }
        vertices.extend(block.len() / layout.row_size, |column, row| columns[column][row]);
    }
}

/// Decodes one column of a block into `values`, replacing its content.
fn decode<const BIG: bool>(block: &[u8], row_size: usize, offset: usize, scalar: Scalar, values: &mut Vec<f64>) {
    fn strided<const N: usize>(block: &[u8], row_size: usize, offset: usize) -> impl Iterator<Item = [u8; N]> {
        // Columns lie within their rows, so the default is never used. `filter_map` would hide the
        // exact size, by which `extend` reserves its memory once.
        let number = move |row: &[u8]| row.get(offset..).and_then(|rest| rest.first_chunk().copied()).unwrap_or([0; N]);
        block.chunks_exact(row_size).map(number)
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

/// Fills `block` with the scalar properties of up to `wanted` rows and skips lists. Returns the
/// number of whole rows.
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

/// Reads the length of a list; returns `None` if the file ends inside it.
fn list_length<const BIG: bool>(
    reader: &mut impl BufRead,
    element: &Element,
    row: u64,
    count: Scalar,
) -> Result<Option<u64>, Fault> {
    let mut bytes = [0; 4];
    let bytes = &mut bytes[..count.size().min(4)];
    if read_until_end(reader, bytes)? < bytes.len() {
        return Ok(None);
    }
    let mut items = Vec::with_capacity(1);
    decode::<BIG>(bytes, bytes.len(), 0, count, &mut items);
    let items = items.first().copied().unwrap_or(0.0);
    if items < 0.0 { Err(negative_list(element, row)) } else { Ok(Some(items as u64)) }
}

/// Skips one list; returns `false` if the file ends inside it.
fn skip_list<const BIG: bool>(
    reader: &mut impl BufRead,
    element: &Element,
    row: u64,
    count: Scalar,
    item: Scalar,
) -> Result<bool, Fault> {
    let Some(items) = list_length::<BIG>(reader, element, row, count)? else { return Ok(false) };
    let size = items * item.size() as u64;
    Ok(skip_bytes(reader, size)? == size)
}

/// Passes each number of one list to `take`; returns `false` if the file ends inside the list.
fn list<const BIG: bool>(
    reader: &mut impl BufRead,
    element: &Element,
    row: u64,
    (count, item): (Scalar, Scalar),
    mut take: impl FnMut(f64) -> Result<(), Fault>,
) -> Result<bool, Fault> {
    let Some(mut items) = list_length::<BIG>(reader, element, row, count)? else { return Ok(false) };
    let (mut block, mut numbers) = (Vec::new(), Vec::new());
    while items > 0 {
        let wanted = items.min((BLOCK / item.size()) as u64);
        block.resize(wanted as usize * item.size(), 0);
        if read_until_end(reader, &mut block)? < block.len() {
            return Ok(false);
        }
        decode::<BIG>(&block, item.size(), 0, item, &mut numbers);
        numbers.iter().try_for_each(|number| take(*number))?;
        items -= wanted;
    }
    Ok(true)
}

fn faces<const BIG: bool>(reader: &mut impl BufRead, element: &Element, faces: &mut Faces) -> Result<(), Fault> {
    let roles = faces.roles(element);
    for row in 0..element.count {
        faces.begin(element);
        for (property, &role) in element.properties.iter().zip(&roles) {
            let mut take = |number| faces.take(element, row, role, number);
            let whole = match (role, property.kind) {
                (Role::Unused, Kind::Scalar(scalar)) => {
                    skip_bytes(reader, scalar.size() as u64)? == scalar.size() as u64
                }
                (Role::Unused, Kind::List { count, item }) => skip_list::<BIG>(reader, element, row, count, item)?,
                (_, Kind::List { count, item }) => list::<BIG>(reader, element, row, (count, item), take)?,
                (_, Kind::Scalar(scalar)) => {
                    let (mut bytes, mut numbers) = (vec![0; scalar.size()], Vec::with_capacity(1));
                    let whole = read_until_end(reader, &mut bytes)? == bytes.len();
                    decode::<BIG>(&bytes, bytes.len(), 0, scalar, &mut numbers);
                    numbers.into_iter().try_for_each(&mut take)?;
                    whole
                }
            };
            if !whole {
                return Err(ends_early(element, row));
            }
        }
        faces.end();
    }
    Ok(())
}

fn skip<const BIG: bool>(reader: &mut impl BufRead, element: &Element) -> Result<(), Fault> {
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

/// Fills `bytes` and returns their count, which is smaller only if the file ends.
pub(super) fn read_until_end(reader: &mut impl Read, bytes: &mut [u8]) -> io::Result<usize> {
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::io::BufReader;

    use super::*;
    use crate::io::ply::header;

    /// Tests both byte orders, and more rows than one block holds.
    #[test]
    fn rows_in_memory_are_those_of_a_stream() {
        let text = "ply\nformat binary_little_endian 1.0\nelement vertex 90000\nproperty double x\nproperty float y\nproperty short z\n\
                    property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
        let header = header::read(&mut text.as_bytes()).unwrap();
        let vertex = &header.elements[0];
        let layout = Layout::of(vertex).unwrap();
        let bytes: Vec<u8> =
            (0..90_000 * layout.row_size as u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 26) as u8).collect();
        assert!(bytes.len() > 2 * BLOCK);
        fn both<const BIG: bool>(bytes: &[u8], vertex: &Element, layout: &Layout) -> [Points; 2] {
            let stream = BufReader::with_capacity(7, bytes);
            let streamed = vertices::<BIG>(stream, vertex, bytes.len() as u64, &()).unwrap().0;
            [streamed, vertices_in::<BIG>(bytes, layout).unwrap().0]
        }
        let ([streamed, lying], [big, lying_big]) =
            (both::<false>(&bytes, vertex, &layout), both::<true>(&bytes, vertex, &layout));
        assert_eq!(streamed.positions.len(), 90_000);
        assert!(streamed == lying && big == lying_big && streamed != big);
    }
}
