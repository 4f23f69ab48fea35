//! PLY files with levels of detail, of which a picture reads only the nodes and points it needs.

use super::binary;
use super::header::{self, Element, Encoding, Kind};
use super::vertex::{Layout, is_tree};
use super::whole;
use crate::Result;
use crate::io::fault::{Fault, reserve};
use crate::io::source::Source;
use crate::io::{Format, Input, Points, Tree, TreeRow};
use crate::scene::{Colors, Hierarchy, Up, Whole};
use rayon::prelude::*;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Two pieces are read in one go, together with the gap between them, if the gap is shorter than
/// this, bytes.
const GAP: u64 = 1 << 14;

/// Longest read that covers more than one piece, bytes.
const SPAN: u64 = 1 << 20;

/// Rows that a thread decodes at once.
const TOGETHER: usize = 1 << 12;

/// Largest magnitude that a number of the element `scene` may have.
const LARGEST: f64 = 1e30;

/// A file that `epsplat lod` wrote, open for reading any of its nodes and points.
///
/// When it is opened, the extents of its elements are checked against the length of the file. Nodes
/// and points are checked as they are read.
pub struct Levels {
    /// Every reader seeks before it reads.
    file: Mutex<Source>,
    path: PathBuf,
    vertex: Stretch,
    node: Stretch,
    /// The facts of all points of the file together, from the element `scene`.
    pub whole: Whole,
    /// The axis that points up, if the file says so.
    pub up: Option<Up>,
    /// The surfels cover a closed surface.
    pub closed: bool,
    /// The normals do not tell the two sides of a surface apart.
    pub unsided: bool,
}

/// Where the rows of an element are in the file.
struct Stretch {
    element: Element,
    /// Offset from the start of the file, bytes.
    start: u64,
    /// Size of a row, bytes.
    size: u64,
}

impl Levels {
    /// Opens a binary little-endian PLY file with levels of detail and the element `scene`. Returns
    /// None for any other file, and for a file whose surfels are drawn together with a mesh.
    ///
    /// # Errors
    ///
    /// [`Error::Read`](crate::Error::Read) if the system cannot read,
    /// [`Error::Malformed`](crate::Error::Malformed) if the header is malformed or a number of the
    /// element `scene` is invalid.
    pub fn open(input: Input) -> Result<Option<Self>> {
        let Input { source: file, length, path, format, .. } = input;
        if format != Format::Ply {
            return Ok(None);
        }
        opened(file, length, &path).map_err(|fault| fault.of(&path))
    }

    /// Size of this many points and nodes in the file, bytes.
    pub fn bytes(&self, points: u64, nodes: u64) -> u64 {
        points * self.vertex.size + nodes * self.node.size
    }

    /// The path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The error that this file is malformed, for the reason `what`.
    pub fn malformed(&self, what: impl Into<String>) -> crate::Error {
        Fault::Malformed(what.into()).of(&self.path)
    }

    /// Reads nodes into `rows`, replacing its content; the ranges of node indices must ascend.
    ///
    /// # Errors
    ///
    /// [`Error::Read`](crate::Error::Read), or [`Error::Malformed`](crate::Error::Malformed) if
    /// there are no nodes with these indices.
    pub fn read_nodes(&self, numbers: &[Range<u32>], rows: &mut Vec<u8>) -> Result<()> {
        self.read(numbers, &self.node, rows)
    }

    /// Decodes `rows` of nodes in parallel parts; returns what `of` makes of each part, in order.
    ///
    /// # Errors
    ///
    /// [`Error::Malformed`](crate::Error::Malformed) if a node has an invalid position,
    /// extent or colour.
    pub fn nodes<T: Send>(&self, rows: &[u8], of: impl Fn(Hierarchy) -> T + Sync) -> Result<Vec<T>> {
        let origin = self.whole.origin;
        let made = |points: Points, rows: Vec<TreeRow>| {
            let nodes = Tree { nodes: Box::new(points), rows }.hierarchy(origin);
            nodes.map(&of).ok_or("a node of its levels of detail has no valid position, extent or colour")
        };
        self.made(rows, &self.node, made)
    }

    /// Reads points and decodes them in parallel parts; returns what `of` makes of each part, in
    /// order. The ranges of point indices must ascend.
    ///
    /// # Errors
    ///
    /// [`Error::Read`](crate::Error::Read), or [`Error::Malformed`](crate::Error::Malformed) if
    /// there are no points with these indices, or `of` returns the reason why some are invalid.
    pub fn points<T: Send>(
        &self,
        numbers: &[Range<u32>],
        of: impl Fn(Points) -> Result<T, &'static str> + Sync,
    ) -> Result<Vec<T>> {
        let mut rows = Vec::new();
        self.read(numbers, &self.vertex, &mut rows)?;
        self.made(&rows, &self.vertex, |points, _| of(points))
    }

    /// Empty colours, of the kind that the file's points have.
    pub fn no_colors(&self) -> Colors {
        let none = binary::vertices::<false>(&[][..], &Element { count: 0, ..self.vertex.element.clone() }, 0, &());
        none.ok().and_then(|(points, ..)| points.colors).unwrap_or_default()
    }

    /// Reads the rows with these indices.
    fn read(&self, numbers: &[Range<u32>], stretch: &Stretch, rows: &mut Vec<u8>) -> Result<()> {
        let Stretch { element, start, size } = stretch;
        let inside = numbers.iter().all(|range| range.start <= range.end && u64::from(range.end) <= element.count);
        if !inside {
            return Err(self.malformed("a node of its levels of detail refers to nodes or points that do not exist"));
        }
        let bytes = |range: &Range<u32>| u64::from(range.end - range.start) * size;
        let pieces = numbers.iter().map(|range| (start + u64::from(range.start) * size, bytes(range)));
        let all = numbers.iter().map(bytes).sum::<u64>();
        rows.clear();
        reserve(rows, all).map_err(|fault| fault.of(&self.path))?;
        rows.resize(all as usize, 0);
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.expect(pieces.clone().map(|(start, bytes)| start..start + bytes))
            .and_then(|()| read_pieces(&mut *file, pieces, rows))
            .map_err(|error| Fault::Io(error).of(&self.path))
    }

    /// Decodes `rows` on all threads and passes each part to `of`.
    fn made<T: Send>(
        &self,
        rows: &[u8],
        Stretch { element, size, .. }: &Stretch,
        of: impl Fn(Points, Vec<TreeRow>) -> Result<T, &'static str> + Sync,
    ) -> Result<Vec<T>> {
        let layout = Layout::of(element).map_err(|fault| fault.of(&self.path))?;
        let made = |bytes: &[u8]| {
            let (points, rows) = binary::vertices_in::<false>(bytes, &layout)?;
            of(points, rows).map_err(|what| Fault::Malformed(what.into()))
        };
        let parts: Result<Vec<T>, Fault> = rows.par_chunks(TOGETHER * *size as usize).map(made).collect();
        parts.map_err(|fault| fault.of(&self.path))
    }
}

fn opened(file: Source, length: u64, path: &Path) -> Result<Option<Levels>, Fault> {
    let mut file = BufReader::new(file);
    let header = header::read(&mut file)?;
    let comments = &header.comments;
    if header.encoding != Encoding::LittleEndian || comments.beside.is_some() {
        return Ok(None);
    }
    let (mut vertex, mut node, mut scene) = (None, None, None);
    let mut start = file.stream_position()?;
    for element in header.elements {
        let scalars = element.properties.iter().map(|property| match property.kind {
            Kind::Scalar(scalar) => Some(scalar.size() as u64),
            Kind::List { .. } => None,
        });
        // Rows with lists differ in length, so the offset of the next element is unknown.
        let Some(size) = scalars.sum::<Option<u64>>() else { return Ok(None) };
        let bytes = element.count.checked_mul(size).and_then(|bytes| bytes.checked_add(start));
        // A file that ends early is reported by the reader of the whole file.
        let Some(end) = bytes.filter(|end| *end <= length) else { return Ok(None) };
        let into = match element.name.as_str() {
            "vertex" => &mut vertex,
            _ if is_tree(&element) => &mut node,
            _ if whole::is_whole(&element) => &mut scene,
            _ => &mut None,
        };
        into.get_or_insert(Stretch { element, start, size });
        start = end;
    }
    let (Some(vertex), Some(node), Some(scene)) = (vertex, node, scene) else { return Ok(None) };
    let layout = Layout::of(&vertex.element)?;
    let counts = [&vertex, &node].map(|rows| u32::try_from(rows.element.count).ok().filter(|count| *count > 0));
    let ([Some(surfels), Some(nodes)], true) = (counts, layout.has_axes_alone()) else { return Ok(None) };
    file.seek(SeekFrom::Start(scene.start))?;
    let mut row = [0; whole::BYTES];
    file.read_exact(&mut row)?;
    let (words, _) = row.as_chunks::<8>();
    if !words.iter().all(|word| f64::from_le_bytes(*word).abs() <= LARGEST) {
        return Err(Fault::Malformed("its element 'scene' has a value that is not a number or is too large".into()));
    }
    let whole = whole::parse(&row, surfels, nodes);
    // f32 coordinates about such an origin lack precision. The reader of the whole file ignores
    // this row, too.
    if !whole.is_near() {
        return Ok(None);
    }
    let (up, closed, unsided) = (comments.up, comments.closed, comments.unsided);
    let file = Mutex::new(file.into_inner());
    Ok(Some(Levels { file, path: path.to_owned(), vertex, node, whole, up, closed, unsided }))
}

/// Reads pieces of a file, given as offset and size, into consecutive parts of `into`.
fn read_pieces(
    file: &mut (impl Read + Seek),
    pieces: impl Iterator<Item = (u64, u64)>,
    mut into: &mut [u8],
) -> io::Result<()> {
    let mut together: Vec<(u64, u64)> = Vec::new();
    let mut span = Vec::new();
    let mut read = |together: &mut Vec<(u64, u64)>| {
        let (Some(&(start, _)), Some(&(last, bytes))) = (together.first(), together.last()) else { return Ok(()) };
        file.seek(SeekFrom::Start(start))?;
        if let [_] = together[..] {
            // Most bytes are in a few long pieces, which are read without a copy.
            file.read_exact(next_of(&mut into, bytes)?)?;
        } else {
            span.resize((last + bytes - start) as usize, 0);
            file.read_exact(&mut span)?;
            for (piece, bytes) in together.iter() {
                let from = (piece - start) as usize;
                next_of(&mut into, *bytes)?.copy_from_slice(&span[from..from + *bytes as usize]);
            }
        }
        together.clear();
        Ok(())
    };
    for (start, bytes) in pieces {
        let near = |&(last, length): &(u64, u64)| (last + length..last + length + GAP).contains(&start);
        let whole = |all: &[(u64, u64)]| all.first().is_some_and(|(first, _)| start + bytes - first > SPAN);
        if !together.last().is_some_and(near) || whole(&together) {
            read(&mut together)?;
        }
        together.push((start, bytes));
    }
    read(&mut together)
}

/// Splits the next `bytes` bytes off the buffer.
fn next_of<'a>(into: &mut &'a mut [u8], bytes: u64) -> io::Result<&'a mut [u8]> {
    into.split_off_mut(..bytes as usize).ok_or_else(|| io::Error::from(io::ErrorKind::WriteZero))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::io::Write;

    use super::*;

    /// Tests pieces of many lengths, with many gaps between them.
    #[test]
    fn pieces_are_read_as_they_lie() {
        let all: Vec<u8> = (0..6 * SPAN as u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&all).unwrap();
        let lengths = [0, 1, 69, GAP, SPAN - GAP, SPAN, SPAN + 1];
        let gaps = [0, 1, GAP - 1, GAP, GAP + 1];
        for (first, second) in (0..7).flat_map(|first| (0..7).map(move |second| (first, second))) {
            for gap in gaps {
                let (mut pieces, mut start) = (Vec::new(), 7);
                for (length, gap) in [(lengths[first], gap), (lengths[second], 1), (5, gap), (3, 2 * SPAN), (9, 0)] {
                    pieces.push((start, length));
                    start += length + gap;
                }
                let expected =
                    pieces.iter().flat_map(|&(start, length)| &all[start as usize..(start + length) as usize]);
                let expected: Vec<u8> = expected.copied().collect();
                let mut found = vec![0; expected.len()];
                read_pieces(&mut file, pieces.iter().copied(), &mut found).unwrap();
                assert!(found == expected, "{pieces:?}");
                assert!(read_pieces(&mut file, pieces.into_iter(), &mut found[1..]).is_err());
            }
        }
        let past = [(all.len() as u64 - 4, 3), (all.len() as u64 - 1, 2)];
        assert!(read_pieces(&mut file, past.into_iter(), &mut [0; 5]).is_err());
    }
}
