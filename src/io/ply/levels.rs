//! PLY files with levels of detail, of which a picture reads the nodes and points that it takes.

use super::binary;
use super::header::{self, Element, Encoding, Kind};
use super::vertex::{Layout, is_tree};
use super::whole;
use crate::Result;
use crate::io::fault::Fault;
use crate::io::{Format, Input, Points, Tree, TreeRow};
use crate::scene::{Colors, Hierarchy, Up, Whole};
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Rows that lie nearer to each other, bytes, are read together with what is between them.
const GAP: u64 = 1 << 14;

/// What is read at once, bytes, where it is more than one piece.
const SPAN: u64 = 1 << 20;

/// Rows that a thread decodes at once.
const TOGETHER: usize = 1 << 12;

/// Numbers of places and ranges are no larger.
const LARGEST: f64 = 1e30;

/// A file that `epsplat lod` wrote, of which any nodes and points can be read.
///
/// When it is opened, where everything lies is checked against its length. Nodes and points are checked as they are read.
pub struct Levels {
    /// Who reads from it moves to where it reads.
    file: Mutex<File>,
    path: PathBuf,
    vertex: Stretch,
    node: Stretch,
    /// What it says of all points together.
    pub whole: Whole,
    /// Which way it says is up.
    pub up: Option<Up>,
    /// Its surfels cover a closed surface.
    pub closed: bool,
    /// Its normals tell no sides.
    pub unsided: bool,
}

/// Where the rows of an element lie.
struct Stretch {
    element: Element,
    /// Bytes from the file's start.
    start: u64,
    /// Bytes of each.
    size: u64,
}

impl Levels {
    /// Opens an input that is a binary PLY file with levels of detail and with what a reader of a part must know; None if it is another one, or is
    /// drawn beside a mesh.
    ///
    /// # Errors
    ///
    /// [`Error::Read`](crate::Error::Read) where the system cannot read, [`Error::Malformed`](crate::Error::Malformed) where what the file says of all points is no number.
    pub fn open(input: Input) -> Result<Option<Self>> {
        let Input { file, length, path, format, .. } = input;
        if format != Format::Ply {
            return Ok(None);
        }
        opened(file, length, &path).map_err(|fault| fault.of(&path))
    }

    /// Bytes of so many points and nodes.
    pub fn bytes(&self, points: u64, nodes: u64) -> u64 {
        points * self.vertex.size + nodes * self.node.size
    }

    /// Its name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the file is found to be.
    pub fn malformed(&self, what: impl Into<String>) -> crate::Error {
        Fault::Malformed(what.into()).of(&self.path)
    }

    /// Reads the rows of the nodes of these ranges of numbers, which ascend, in place of those that are there.
    ///
    /// # Errors
    ///
    /// [`Error::Read`](crate::Error::Read), or [`Error::Malformed`](crate::Error::Malformed) where the ranges are no nodes.
    pub fn read_nodes(&self, numbers: &[Range<u32>], rows: &mut Vec<u8>) -> Result<()> {
        self.read(numbers, &self.node, rows)
    }

    /// What `of` makes of the nodes of rows, in parts.
    ///
    /// # Errors
    ///
    /// [`Error::Malformed`](crate::Error::Malformed) where a node has no place or extent.
    pub fn nodes<T: Send>(&self, rows: &[u8], of: impl Fn(Hierarchy) -> T + Sync) -> Result<Vec<T>> {
        let origin = self.whole.origin;
        let made = |points: Points, rows: Vec<TreeRow>| {
            let nodes = Tree { nodes: Box::new(points), rows }.hierarchy(origin);
            nodes.map(&of).ok_or("a node of its levels of detail has no place, no extent or no colour")
        };
        self.made(rows, &self.node, made)
    }

    /// What `of` makes of the points of these ranges of numbers, which ascend, in parts, or what is wrong with these.
    ///
    /// # Errors
    ///
    /// [`Error::Read`](crate::Error::Read), or [`Error::Malformed`](crate::Error::Malformed) where something is wrong, or the ranges are no points.
    pub fn points<T: Send>(
        &self,
        numbers: &[Range<u32>],
        of: impl Fn(Points) -> Result<T, &'static str> + Sync,
    ) -> Result<Vec<T>> {
        let mut rows = Vec::new();
        self.read(numbers, &self.vertex, &mut rows)?;
        self.made(&rows, &self.vertex, |points, _| of(points))
    }

    /// Colours as points have them, of none.
    pub fn no_colors(&self) -> Colors {
        let none = binary::vertices::<false>(&[][..], &Element { count: 0, ..self.vertex.element.clone() }, 0, &());
        none.ok().and_then(|(points, _)| points.colors).unwrap_or_default()
    }

    /// Reads the rows of these numbers.
    fn read(&self, numbers: &[Range<u32>], stretch: &Stretch, rows: &mut Vec<u8>) -> Result<()> {
        let Stretch { element, start, size } = stretch;
        let inside = numbers.iter().all(|range| range.start <= range.end && u64::from(range.end) <= element.count);
        if !inside {
            return Err(self.malformed("a node of its levels of detail names what does not exist"));
        }
        let bytes = |range: &Range<u32>| u64::from(range.end - range.start) * size;
        let pieces = numbers.iter().map(|range| (start + u64::from(range.start) * size, bytes(range)));
        rows.resize(numbers.iter().map(bytes).sum::<u64>() as usize, 0);
        read_pieces(&mut self.file.lock().unwrap_or_else(PoisonError::into_inner), pieces, rows)
            .map_err(|error| Fault::Io(error).of(&self.path))
    }

    /// What all threads make of rows.
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

fn opened(file: File, length: u64, path: &Path) -> Result<Option<Levels>, Fault> {
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
        // Where rows differ in length, what is behind them lies nobody knows where.
        let Some(size) = scalars.sum::<Option<u64>>() else { return Ok(None) };
        let bytes = element.count.checked_mul(size).and_then(|bytes| bytes.checked_add(start));
        // What ends early is told by who reads all of it.
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
        return Err(Fault::Malformed("what its element 'scene' says is no number, or too large".into()));
    }
    let whole = whole::parse(&row, surfels, nodes);
    // Who reads all of it passes over that, too.
    if !whole.is_near() {
        return Ok(None);
    }
    let (up, closed, unsided) = (comments.up, comments.closed, comments.unsided);
    let file = Mutex::new(file.into_inner());
    Ok(Some(Levels { file, path: path.to_owned(), vertex, node, whole, up, closed, unsided }))
}

/// Reads pieces of a file, each of which starts where it says and has so many bytes, one after the other `into` as many.
fn read_pieces(file: &mut File, pieces: impl Iterator<Item = (u64, u64)>, mut into: &mut [u8]) -> io::Result<()> {
    let mut together: Vec<(u64, u64)> = Vec::new();
    let mut span = Vec::new();
    let mut read = |together: &mut Vec<(u64, u64)>| {
        let (Some(&(start, _)), Some(&(last, bytes))) = (together.first(), together.last()) else { return Ok(()) };
        file.seek(SeekFrom::Start(start))?;
        if let [_] = together[..] {
            // Most of what is read lies in few pieces, which need no copy.
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

/// The next so many bytes of what is written into.
fn next_of<'a>(into: &mut &'a mut [u8], bytes: u64) -> io::Result<&'a mut [u8]> {
    into.split_off_mut(..bytes as usize).ok_or_else(|| io::Error::from(io::ErrorKind::WriteZero))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::io::Write;

    use super::*;

    /// However near to each other pieces lie, and however long they are.
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
