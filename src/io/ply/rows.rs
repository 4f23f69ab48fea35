//! Rows of surfels, all of equal length, that any thread can read at any index. They are in a
//! binary PLY file, or in an unnamed temporary file.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::binary;
use super::contents::ends_early;
use super::faces::Faces;
use super::header::{self, Comments, Element, Encoding, Kind};
use super::vertex::{Layout, is_tree};
use super::write::Properties;
use super::write_scene::vertex;
use crate::io::color_range::Survey;
use crate::io::fault::Fault;
use crate::io::{ColorRules, Format, Input, Points};
use crate::scene::Scene;
use crate::{Error, Progress, Result};

/// Rows that are copied at once.
const TOGETHER: u64 = 1 << 16;

/// The rows of one element of a file.
pub struct Rows {
    /// None for an input, which is opened for each read: a process may not be able to hold all of
    /// its inputs open.
    file: Option<Mutex<File>>,
    /// The name of the file in error messages, and the path of an input.
    path: PathBuf,
    element: Element,
    layout: Layout,
    /// Offset of the first row, bytes.
    start: u64,
    /// Size of a row, bytes.
    size: u64,
    big: bool,
    /// The properties of rows that are written; None for an input.
    written: Option<Properties>,
    comments: Comments,
    /// The rules that decide what colour numbers mean.
    rules: ColorRules,
}

impl Rows {
    /// Opens the vertex rows of a binary PLY file. Returns None for any other file, and for a file
    /// whose vertices are not merely disks:
    ///
    /// - meshes, Gaussians, and vertices with texture coordinates;
    /// - files with levels of detail, and files that are drawn together with a mesh;
    /// - vertices without half-axes that lack normals or radii.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] if the system cannot read, [`Error::Malformed`] if the header is not a PLY
    /// header or promises more vertices than the file holds.
    pub fn open(input: Input, ignore_alpha: bool) -> Result<Option<Self>> {
        let Input { mut source, length, path, format, .. } = input;
        let Some(file) = source.file().filter(|_| format == Format::Ply) else { return Ok(None) };
        let mut reader = BufReader::new(file);
        let mut opened = || {
            let header = header::read(&mut reader)?;
            let start = reader.stream_position()?;
            Ok((header, start))
        };
        let (mut header, start) = opened().map_err(|fault: Fault| fault.of(&path))?;
        header.elements.iter_mut().for_each(|element| element.tints.ignore_alpha = ignore_alpha);
        let other =
            header.elements.iter().skip(1).any(|element| is_tree(element) || Faces::are(element) && element.count > 0);
        let Some(element) = header.elements.into_iter().next().filter(|first| first.name == "vertex" && !other) else {
            return Ok(None);
        };
        let lists = element.properties.iter().any(|property| matches!(property.kind, Kind::List { .. }));
        if header.encoding == Encoding::Ascii || header.comments.beside.is_some() || lists {
            return Ok(None);
        }
        let layout = Layout::of(&element).map_err(|fault| fault.of(&path))?;
        let size = layout.row_size as u64;
        let whole = element.count.checked_mul(size).is_some_and(|bytes| bytes <= length.saturating_sub(start));
        let big = header.encoding == Encoding::BigEndian;
        if !whole {
            let rows = length.saturating_sub(start) / size.max(1);
            return Err(ends_early(&element, rows).of(&path));
        }
        let comments = header.comments;
        let sound = layout.is_disk() || element.count == 0;
        let rules = ColorRules::default();
        Ok(sound.then_some(Self {
            file: None,
            path,
            element,
            layout,
            start,
            size,
            big,
            written: None,
            comments,
            rules,
        }))
    }

    /// Creates an empty array of rows with these properties in an unnamed file in `folder`. The
    /// system deletes the file when the array is dropped. Errors call the file `path`.
    ///
    /// # Errors
    ///
    /// [`Error::Write`] if the system cannot create the file.
    pub fn temporary(folder: &Path, properties: Properties, path: &Path) -> Result<Self> {
        let file = tempfile::tempfile_in(folder).map_err(|error| Error::write(path, error))?;
        let mut text = Vec::new();
        let header = properties.write_header(&mut text, 0, &[]).and_then(|()| text.write_all(b"end_header\n"));
        header.map_err(|error| Error::write(path, error))?;
        let element = header::read(&mut &text[..]).map_err(|fault| fault.of(path))?.elements.remove(0);
        let layout = Layout::of(&element).map_err(|fault| fault.of(path))?;
        let size = layout.row_size as u64;
        let (file, path) = (Some(Mutex::new(file)), path.to_owned());
        let written = Some(properties);
        let (comments, rules) = (Comments::default(), ColorRules::default());
        Ok(Self { file, path, element, layout, start: 0, size, big: false, written, comments, rules })
    }

    /// The number of rows.
    pub fn count(&self) -> u64 {
        self.element.count
    }

    /// Whether the file says that its surfels cover a closed surface.
    pub fn is_closed(&self) -> bool {
        self.comments.closed
    }

    /// Size of a row, bytes.
    pub fn size(&self) -> usize {
        self.size as usize
    }

    /// The path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The error that this file is malformed, for the reason `what`.
    pub fn malformed(&self, what: impl Into<String>) -> Error {
        Error::malformed(&self.path, what)
    }

    /// The row indices in ranges of `piece`, of which the last may be shorter.
    pub fn pieces(&self, piece: u64) -> Vec<Range<u64>> {
        let starts = (0..self.count()).step_by(piece.max(1) as usize);
        starts.map(|start| start..self.count().min(start + piece)).collect()
    }

    /// Reads the bytes of these rows.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] if the system cannot read.
    pub fn bytes(&self, numbers: Range<u64>) -> Result<Vec<u8>> {
        let mut bytes = vec![0; ((numbers.end - numbers.start) * self.size) as usize];
        let start = self.start + numbers.start * self.size;
        let mut read = |file: &mut File| file.seek(SeekFrom::Start(start)).and_then(|_| file.read_exact(&mut bytes));
        let read = match &self.file {
            Some(file) => read(&mut lock(file)),
            None => File::open(&self.path).and_then(|mut file| read(&mut file)),
        };
        read.map(|()| bytes).map_err(|error| Error::read(&self.path, error))
    }

    /// Decodes the bytes of whole rows as points.
    ///
    /// # Errors
    ///
    /// [`Error::Malformed`] if the rows cannot be decoded.
    pub fn points(&self, bytes: &[u8]) -> Result<Points> {
        let mut points = self.raw(bytes)?;
        // Notes are dropped: a piece may look odd where the whole file does not.
        self.rules.clone().settle(std::slice::from_mut(&mut points));
        points.notes.clear();
        let Comments { up, closed, unsided, .. } = self.comments;
        Ok(Points { up, closed, unsided, ..points })
    }

    /// Decodes rows, with colours as they are in the file.
    fn raw(&self, bytes: &[u8]) -> Result<Points> {
        let read = match self.big {
            true => binary::vertices_in::<true>(bytes, &self.layout),
            false => binary::vertices_in::<false>(bytes, &self.layout),
        };
        read.map(|(points, _)| points).map_err(|fault| fault.of(&self.path))
    }

    /// Decides what colour numbers mean, from all `files` of one scene together. Reads all rows of
    /// each file whose layout does not decide it.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] if the system cannot read, [`Error::Malformed`] if rows cannot be decoded.
    pub fn settle_colors(files: &mut [Self]) -> Result<()> {
        let (mut survey, mut rules) = (Survey::default(), ColorRules::default());
        for file in files.iter_mut().filter(|file| file.layout.is_judged_whole()) {
            file.settle_looks()?;
            for piece in file.pieces(TOGETHER) {
                if let Some(raw) = &file.raw(&file.bytes(piece)?)?.raw {
                    survey.add(raw);
                }
            }
        }
        rules.decide(&survey);
        files.iter_mut().for_each(|file| file.rules.clone_from(&rules));
        Ok(())
    }

    /// Chooses colours, or intensities if all colours of the file are zero.
    fn settle_looks(&mut self) -> Result<()> {
        if self.layout.color.is_none() || self.layout.intensity.is_none() {
            return Ok(());
        }
        let mut colored = false;
        for piece in self.pieces(TOGETHER) {
            colored = self.raw(&self.bytes(piece)?)?.raw.is_some_and(|raw| raw.is_colored());
            if colored {
                break;
            }
        }
        self.layout.show(colored);
        Ok(())
    }

    /// The bytes of these surfels of `scene`, as rows to append.
    pub fn encoded(&self, scene: &Scene, surfels: Range<usize>) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(surfels.len() * self.size());
        let properties = self.written.unwrap_or_default();
        surfels.for_each(|index| properties.encode(&vertex(scene, index), &mut bytes));
        bytes
    }

    /// Appends rows, given as bytes.
    ///
    /// # Errors
    ///
    /// [`Error::Write`] if the system cannot write.
    pub fn append(&mut self, bytes: &[u8]) -> Result<()> {
        let end = self.start + self.count() * self.size;
        let written = self.file.as_ref().map_or(Ok(()), |file| {
            let mut file = lock(file);
            file.seek(SeekFrom::Start(end)).and_then(|_| file.write_all(bytes))
        });
        self.element.count += bytes.len() as u64 / self.size.max(1);
        written.map_err(|error| Error::write(&self.path, error))
    }

    /// Writes all rows to `out` and reports the progress.
    pub(super) fn copy(&self, out: &mut impl Write, progress: &dyn Progress) -> Result<()> {
        for piece in self.pieces(TOGETHER) {
            let count = piece.end - piece.start;
            out.write_all(&self.bytes(piece)?).map_err(|error| Error::write(&self.path, error))?;
            progress.advance(count);
        }
        Ok(())
    }
}

/// A poisoned lock is no problem: each access seeks first.
fn lock(file: &Mutex<File>) -> MutexGuard<'_, File> {
    file.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The position of a row whose coordinates are f64.
pub fn position(row: &[u8]) -> [f64; 3] {
    let (words, _) = row.as_chunks::<8>();
    [0, 1, 2].map(|k| words.get(k).map_or(f64::NAN, |word| f64::from_le_bytes(*word)))
}
