//! COPC 1.0: LAZ files whose chunks are the nodes of an octree. A picture needs only a few nodes.

use super::chunks::{MOST_A_BYTE, Scheme, laszip_record, malformed, promised};
use super::dimensions::Dimensions;
use super::extra::Normals;
use super::layers::Layers;
use super::shown::Shown;
use super::{Looks, early, header, of_las, shape_of};
use crate::io::fault::{self, Fault, surviving};
use crate::io::source::Source;
use crate::io::{ColorRules, Format, Input, degrees};
use crate::scene::Bounds;
use crate::scene::octree::{MOST_LEVELS, OctreeNode, PointOctree};
use crate::{Error, Result};
use glam::DVec3;
use las::{Transform, Vector, raw};
use std::collections::BTreeMap;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::PathBuf;

/// Offsets of the header and of the data of the first record, bytes: there a COPC file identifies
/// itself.
const RECORD: u64 = 375;
const INFO: u64 = RECORD + 54;
const INFO_SIZE: usize = 160;

/// Size of an entry in the pages of the octree, bytes.
const ENTRY: u64 = 32;

/// A COPC file, open for reading any of its nodes.
///
/// The octree is checked when the file is opened: no node occurs twice, each has a parent, and its
/// chunk lies within the file.
pub struct Copc {
    pub(super) source: Source,
    pub(super) path: PathBuf,
    /// The nodes of the file.
    pub octree: PointOctree,
    /// The chunk of each node.
    pub(super) chunks: Vec<Chunk>,
    /// The needed layers of each node, once its chunk has been looked at.
    pub(super) layers: Vec<Option<Layers>>,
    pub(super) scheme: Scheme,
    /// The data of the record that says how chunks are compressed.
    pub(super) laszip: Vec<u8>,
    pub(super) format: las::point::Format,
    pub(super) transforms: Vector<Transform>,
    /// The number of points of all nodes.
    pub(super) count: u64,
    /// The attribute that is drawn as colour, once points have been read.
    pub(super) looks: Option<Looks>,
    /// The rules for colour numbers; the first nodes that [`read`](Self::read) reads decide them.
    pub(super) rules: ColorRules,
    /// The normals among the extra bytes of points.
    pub(super) normals: Option<Normals>,
    /// The numbers of records.
    pub(super) dimensions: Dimensions,
    /// Sentences about odd fields of the header.
    pub(super) notes: Vec<String>,
}

/// Where the points of a node are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Chunk {
    /// Offset from the start of the file, bytes.
    pub offset: u64,
    pub bytes: u64,
    /// Index of its first point in the order of the file.
    pub first: u64,
}

/// An entry of an octree page, for a node.
struct Entry {
    offset: u64,
    bytes: u64,
    points: u64,
}

impl Copc {
    /// Opens a COPC file; returns None for any other file.
    ///
    /// # Errors
    ///
    /// [`Error::Read`] if the system cannot read, [`Error::Malformed`] if the file says that it is
    /// COPC but is invalid.
    pub fn open(input: Input) -> Result<Option<Self>> {
        let Input { source, length, path, format, .. } = input;
        let again = source.try_clone().map_err(|error| Error::read(&path, error))?;
        let opened = surviving(|| {
            if format != Format::Las || !says_copc(&source)? {
                return Ok(None);
            }
            opened(source, path.clone(), length).map(Some).map_err(early)
        });
        again.check().map_err(|error| Error::read(&path, error))?;
        opened.map_err(|fault| fault.of(&path))
    }

    /// Size of the chunks of all nodes, bytes.
    pub fn bytes(&self) -> u64 {
        self.chunks.iter().map(|chunk| chunk.bytes).sum()
    }

    /// Bytes that [`read`](Self::read) reads for these nodes; a node that was never read counts 0.
    pub fn bytes_read(&self, nodes: &[usize]) -> u64 {
        nodes.iter().filter_map(|&node| self.layers[node].as_ref()).map(Layers::bytes).sum()
    }

    /// The number of points of all nodes.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Frees the memory of bytes that were received from a server and may be read again.
    pub fn forget(&self) {
        self.source.forget();
    }

    /// Adds the path of the file to an error.
    pub(super) fn fault(&self, fault: Fault) -> Error {
        fault.of(&self.path)
    }
}

/// Whether the first record of a file is that of COPC.
fn says_copc(source: &Source) -> Result<bool, Fault> {
    let mut start = Vec::new();
    source.read_at(0, INFO, &mut start)?;
    let record = start.get(RECORD as usize..);
    let named = record
        .and_then(|record| record.get(2..20))
        .is_some_and(|name| name.starts_with(b"copc\0") && name.ends_with(&[1, 0]));
    Ok(named && start.starts_with(b"LASF"))
}

fn opened(mut file: Source, path: PathBuf, length: u64) -> Result<Copc, Fault> {
    file.rewind()?;
    let mut file = BufReader::new(Shown::new(file)?);
    let legacy = file.get_ref().legacy;
    let header = raw::Header::read_from(&mut file).map_err(of_las)?;
    let record = u64::from(header.point_data_record_length);
    let laszip = laszip_record(&mut file, &header)?.map(|(_, data)| data);
    let scheme = laszip.as_deref().and_then(Scheme::parse);
    let (Some(laszip), Some(mut scheme)) = (laszip, scheme.filter(|scheme| scheme.compressor == 3)) else {
        return malformed("it says that it is COPC, but its points are not compressed in layers");
    };
    let (format, transforms) = shape_of(&header)?;
    if scheme.record != record {
        return malformed("its LASzip record does not describe its points");
    }
    if !format.is_extended || scheme.has_color != format.has_color {
        // In this case, bytes that are read as colours come from other items, so all layers are
        // needed.
        scheme.needed.fill(true);
        scheme.intensities = None;
    }
    // Intensities are needed until a colour that is not zero has been read.
    scheme.need_intensities(true);
    let mut info = [0; INFO_SIZE];
    file.seek(SeekFrom::Start(INFO))?;
    file.read_exact(&mut info)?;
    let (words, _) = info.as_chunks::<8>();
    let [x, y, z, half, spacing] = [0, 1, 2, 3, 4].map(|at| f64::from_le_bytes(words[at]));
    let (center, root) = (DVec3::new(x, y, z), [5, 6].map(|at| u64::from_le_bytes(words[at])));
    if !(center.is_finite() && half.is_finite() && half > 0.0 && spacing.is_finite() && spacing > 0.0) {
        return malformed("its octree has no valid centre, size or spacing");
    }
    let entries = entries(&mut file, root, length)?;
    let (nodes, chunks) = checked(entries, (&scheme, length))?;
    let count = nodes.iter().map(|node| node.points).sum();
    if count != promised(&header) {
        return malformed(format!("its octree has {count} points, and its header promises {}", promised(&header)));
    }
    let [min, max] =
        [DVec3::new(header.min_x, header.min_y, header.min_z), DVec3::new(header.max_x, header.max_y, header.max_z)];
    let bounds = if min.is_finite() && max.is_finite() { Bounds { min, max } } else { Bounds::EMPTY };
    let name = fault::name(&path);
    let found = header::look(&mut file, (&header, legacy), (length, &name))?;
    found.normals.iter().flat_map(|normals| &normals.fields).for_each(|field| scheme.need_extra(field));
    let mut notes = found.notes;
    notes.extend(degrees::hint(&name, [min.to_array(), max.to_array()], found.geographic));
    let octree = PointOctree { center, half, spacing, nodes, bounds };
    Ok(Copc {
        source: file.into_inner().into_source(),
        path,
        octree,
        layers: vec![None; chunks.len()],
        chunks,
        scheme,
        laszip,
        format,
        transforms,
        count,
        looks: None,
        rules: ColorRules::default(),
        normals: found.normals,
        dimensions: found.dimensions,
        notes,
    })
}

/// Reads the entries of all pages of the octree, starting at the root page. Keys are level and
/// position.
fn entries(
    file: &mut BufReader<Shown>,
    root: [u64; 2],
    length: u64,
) -> Result<BTreeMap<(u32, [u32; 3]), Entry>, Fault> {
    let mut entries = BTreeMap::new();
    let mut pages = vec![root];
    // This limit ends the loop if pages refer to each other in a circle: the file cannot hold as
    // many entries.
    let mut left = length / ENTRY;
    while let Some([offset, bytes]) = pages.pop() {
        let within = offset.checked_add(bytes).is_some_and(|end| end <= length);
        let Some(rest) = left.checked_sub(bytes / ENTRY).filter(|_| within && bytes % ENTRY == 0 && bytes > 0) else {
            return malformed(format!(
                "a page of its octree, {bytes} bytes at byte {offset}, does not fit in the file"
            ));
        };
        left = rest;
        file.get_ref().source().expect(std::iter::once(offset..offset + bytes))?;
        file.seek(SeekFrom::Start(offset))?;
        for _ in 0..bytes / ENTRY {
            let mut entry = [0; ENTRY as usize];
            file.read_exact(&mut entry)?;
            let [level, x, y, z, _, _, bytes, points] =
                std::array::from_fn(|at| i32::from_le_bytes(entry.as_chunks().0[at]));
            let offset = u64::from_le_bytes(entry.as_chunks().0[2]);
            let name = || format!("{level}-{x}-{y}-{z}");
            let whole = [level, x, y, z].map(u32::try_from);
            let ([Ok(level), Ok(x), Ok(y), Ok(z)], Ok(bytes)) = (whole, u64::try_from(bytes)) else {
                return malformed(format!("node {} of its octree has an invalid position or size", name()));
            };
            if level >= MOST_LEVELS || [x, y, z].iter().any(|place| u64::from(*place) >> level > 0) {
                return malformed(format!("node {} lies outside its octree", name()));
            }
            if points == -1 {
                pages.push([offset, bytes]);
                continue;
            }
            let Ok(points) = u64::try_from(points) else {
                return malformed(format!("node {} of its octree has {points} points", name()));
            };
            if entries.insert((level, [x, y, z]), Entry { offset, bytes, points }).is_some() {
                return malformed(format!("node {} is twice in its octree", name()));
            }
        }
    }
    Ok(entries)
}

/// Returns the nodes and their chunks, sorted by level and position. Checks that each node has a
/// parent, and that chunks lie in the file and do not overlap.
fn checked(
    entries: BTreeMap<(u32, [u32; 3]), Entry>,
    (scheme, length): (&Scheme, u64),
) -> Result<(Vec<OctreeNode>, Vec<Chunk>), Fault> {
    let (mut nodes, mut chunks) = (Vec::new(), Vec::new());
    for (&(level, place), entry) in &entries {
        let &Entry { offset, bytes, points } = entry;
        let name = || format!("{level}-{}-{}-{}", place[0], place[1], place[2]);
        if level > 0 && !entries.contains_key(&(level - 1, place.map(|place| place >> 1))) {
            return malformed(format!("node {} of its octree has no parent", name()));
        }
        let fits = offset.checked_add(bytes).is_some_and(|end| end <= length);
        if points > 0 && !(fits && bytes >= scheme.start() && points / MOST_A_BYTE <= bytes) {
            return malformed(format!(
                "the {points} points of node {}, {bytes} bytes at byte {offset}, do not fit in the file",
                name()
            ));
        }
        nodes.push(OctreeNode { level, place, points });
        chunks.push(Chunk { offset, bytes: if points > 0 { bytes } else { 0 }, first: 0 });
    }
    let mut in_file: Vec<usize> = (0..nodes.len()).filter(|&node| nodes[node].points > 0).collect();
    in_file.sort_unstable_by_key(|&node| chunks[node].offset);
    let mut first = 0u64;
    for pair in in_file.windows(2) {
        if chunks[pair[0]].offset + chunks[pair[0]].bytes > chunks[pair[1]].offset {
            return malformed("two nodes of its octree overlap in the file");
        }
    }
    for node in in_file {
        chunks[node].first = first;
        first += nodes[node].points;
    }
    Ok((nodes, chunks))
}
