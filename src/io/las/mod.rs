//! LAS and LAZ 1.0 to 1.5, through the `las` crate.

mod arithmetic;
mod chunks;
mod copc;
mod dimensions;
mod extra;
mod header;
mod layers;
mod nodes;
mod rest;
mod shown;
mod system;

use crate::io::color_range::{Kind, Number, Numbers, RawColors, Shades, Values};
use crate::io::fault::{self, Fault, reserve, surviving};
use crate::io::source::Source;
use crate::io::values::one_line;
use crate::io::{Input, Points, ReadOptions, Up, degrees};
use crate::{Error, Progress, Result};
use dimensions::Wants;
use extra::Normals;
use header::Found;
use las::reader::{LazParallelism, ReaderOptions};
use las::{PointData, PointDataBuilder, Reader, Transform, Vector, raw};
use shown::Shown;
use std::collections::BTreeMap;
use std::io::{self, BufReader, Seek};
use std::ops::Range;
use std::path::Path;

pub use copc::Copc;
pub(super) use header::geo_keys;

/// Size of the records that are decoded together, bytes.
const BLOCK: u64 = 1 << 25;

/// Reads the points of a LAS or LAZ file, including COPC.
///
/// Two kinds of points are left out: withheld ones, which are marked as deleted, unless
/// [`ReadOptions::keep_withheld`] is set; and those whose class has the opacity 0. They are counted
/// in [`Points::withheld`] and [`Points::unseen`]. Synthetic, key and overlap points (legacy class
/// 12 too) are read like any other, as PDAL does.
///
/// Coordinates are scaled and offset in f64, in the file's own coordinate system; z is up. Colours
/// are the 16-bit RGB of the point format. If all are zero or missing, intensities are used
/// ([`RawColors`]). [`Points::notes`] names fields of the header that contradict each other.
///
/// A chunk of a compressed file that cannot be decoded is left out and named in [`Points::unread`],
/// if another one can be decoded and [`ReadOptions::strict`] is not set.
///
/// # Errors
///
/// [`Error::Read`] if the system cannot read, [`Error::Malformed`] if the file is not LAS, ends
/// early, or cannot be decoded.
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let Input { source, length, path, .. } = input;
    let clone = || source.try_clone().map_err(|error| Error::read(&path, error));
    let (first, again) = (clone()?, clone()?);
    let points = match whole((first, length), &path, options, progress) {
        Err(Fault::Malformed(what)) if !options.strict => {
            let points = deep(|| rest::read((again, length), &path, options, progress));
            // The first attempt has found the cause.
            points.map_err(|fault| match fault {
                Fault::Malformed(_) => Fault::Malformed(what),
                of_system => of_system,
            })
        }
        points => points,
    };
    source.check().map_err(|error| Error::read(&path, error))?;
    points.map_err(|fault| fault.of(&path))
}

/// Reads all points of an intact file.
fn whole(
    (file, length): (Source, u64),
    path: &Path,
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<Points, Fault> {
    let name = fault::name(path);
    let opened = surviving(|| {
        let mut file = BufReader::with_capacity(1 << 20, Shown::new(file)?);
        let legacy = file.get_ref().legacy;
        let header = raw::Header::read_from(&mut file).map_err(of_las)?;
        let decoding = chunks::check(&mut file, &header, length).map_err(early)?;
        let found = header::look(&mut file, (&header, legacy), (length, &name)).map_err(early)?;
        Ok((file, decoding, chunks::promised(&header), found))
    });
    let (file, decoding, promised, found) = opened?;
    if promised == 0 {
        // The decoder is not called: it would trust the length of the chunk table, which was not
        // checked.
        let mut points = Points { up: Some(Up::Z), ..Points::default() };
        let wants = found.dimensions.collector(&options.wanted)?;
        wants.map_or(Ok(()), |wants| wants.collector.finish(&mut points, false))?;
        return Ok(described(points, found, &name, options));
    }
    progress.begin(&format!("reading {name}"), promised);
    let points = deep(|| decode(file, decoding, promised.min(length), (options, &found), progress));
    progress.end();
    Ok(described(points?, found, &name, options))
}

/// Stack size of the threads that decode, bytes; pages are committed only when they are used. The
/// decoder recurses at each change between GPS time sequences (laz 0.13.0), and a damaged file of a
/// few bytes can contain a million of them in a row. A call takes 64 bytes of stack, so this
/// suffices for four million; with the usual 2 MiB the process would be aborted.
const DECODER_STACK: usize = 1 << 28;

/// Runs `decode`, which may panic, on threads whose stacks are deep enough for damaged files.
fn deep<T: Send>(decode: impl FnOnce() -> Result<T, Fault> + Send) -> Result<T, Fault> {
    // The decoder may panic on any of the threads.
    let pool =
        rayon::ThreadPoolBuilder::new().stack_size(DECODER_STACK).start_handler(|_| fault::hush_thread()).build();
    pool.map_err(|error| Fault::Io(io::Error::other(error)))?.install(|| surviving(decode))
}

/// Sorts the decoder's errors into those of the file and those of the system.
fn of_las(error: las::Error) -> Fault {
    match error {
        las::Error::Io(error) => early(Fault::Io(error)),
        las::Error::InvalidFileSignature(_) => {
            Fault::Malformed("it is not a LAS file: it does not begin with 'LASF'".into())
        }
        other => Fault::Malformed(one_line(&other.to_string())),
    }
}

fn early(fault: Fault) -> Fault {
    match fault {
        Fault::Io(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
            Fault::Malformed("the file ends early".into())
        }
        Fault::Io(error) if matches!(error.kind(), io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput) => {
            Fault::Malformed(one_line(&error.to_string()))
        }
        other => other,
    }
}

fn decode(
    mut file: BufReader<Shown>,
    decoding: chunks::Decoding,
    capacity: u64,
    (read_options, found): (&ReadOptions, &Found),
    progress: &dyn Progress,
) -> Result<Points, Fault> {
    file.rewind()?;
    let parallelism = match decoding {
        chunks::Decoding::Parallel => LazParallelism::Yes,
        chunks::Decoding::Sequential => LazParallelism::No,
    };
    let options = ReaderOptions::default().with_laz_parallelism(parallelism);
    let mut reader = Reader::with_options(file, options).map_err(of_las)?;
    let header = reader.header();
    let promised = header.number_of_points();
    let format = *header.point_format();
    let mut block = PointDataBuilder::new().for_header(header).build();
    let block_points = (BLOCK / u64::from(format.len()).max(1)).max(1);
    let mut kept = Kept::of(None, found.normals.as_ref());
    kept.wants = found.dimensions.collector(&read_options.wanted)?;
    reserve(&mut kept.positions, capacity)?;
    let mut read = 0;
    while read < promised {
        let count = reader.fill_points(block_points, &mut block).map_err(|error| match early(of_las(error)) {
            Fault::Malformed(what) => Fault::Malformed(format!(
                "the header promises {promised} points, but decoding fails after {read}: {what}"
            )),
            other => other,
        })?;
        if count == 0 {
            return Err(Fault::Malformed(format!("the header promises {promised} points, the file ends after {read}")));
        }
        kept.take(&block, read, read_options);
        read += count;
        progress.advance(count);
    }
    kept.points(0..read, read_options)
}

/// Adds the file's description of itself, and notes about odd fields and coordinates. `name` is the
/// file's name.
fn described(mut points: Points, found: Found, name: &str, options: &ReadOptions) -> Points {
    points.notes.extend(found.notes.iter().cloned());
    points.notes.extend(found.outside(name, &points.positions));
    points.notes.extend(degrees::hint_of(name, &points.positions, found.geographic));
    points.about = options.describe.then(|| Box::new(found.about));
    points.raw.iter_mut().for_each(|raw| name.clone_into(&mut raw.name));
    points
}

/// The format of a file's records, and the scales and offsets of its coordinates.
fn shape_of(header: &raw::Header) -> Result<(las::point::Format, Vector<Transform>), Fault> {
    let record = header.point_data_record_length;
    let mut format = las::point::Format::new(header.point_data_record_format & 0x3f).map_err(of_las)?;
    let Some(extra) = record.checked_sub(format.len()) else {
        return chunks::malformed("its LASzip record does not describe its points");
    };
    format.extra_bytes = extra;
    let transform = |scale, offset| Transform { scale, offset };
    let transforms = Vector {
        x: transform(header.x_scale_factor, header.x_offset),
        y: transform(header.y_scale_factor, header.y_offset),
        z: transform(header.z_scale_factor, header.z_offset),
    };
    Ok((format, transforms))
}

/// The attribute that is drawn as the colour of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Looks {
    Colors,
    Intensities,
}

/// Collects points block by block.
#[derive(Default)]
struct Kept<'a> {
    positions: Vec<[f64; 3]>,
    /// Where the normals are among the extra bytes, and their values.
    has_normals: Option<&'a Normals>,
    normals: Vec<[f32; 3]>,
    codes: Vec<[u16; 3]>,
    /// Collected until a colour that is not zero occurs.
    intensities: Vec<u16>,
    /// The attribute that is drawn as colour, once it is known.
    looks: Option<Looks>,
    /// `looks` was known before these points were read.
    decided: bool,
    /// The class of each point, if classes have different opacities.
    classes: Vec<u8>,
    /// The number of points of each class, without deleted ones.
    counts: BTreeMap<u8, u64>,
    left_out: Vec<u64>,
    /// Collects the wanted attributes, if there are any.
    wants: Option<Wants>,
}

impl<'a> Kept<'a> {
    /// An empty collection; `looks` is known if other points of the file have been read.
    fn of(looks: Option<Looks>, has_normals: Option<&'a Normals>) -> Self {
        Self { looks, decided: looks.is_some(), has_normals, ..Self::default() }
    }

    /// The collected points, with colours as they are in the file. `numbers` are the indices of all
    /// points that were read, in order.
    fn points(self, numbers: impl Iterator<Item = u64>, options: &ReadOptions) -> Result<Points, Fault> {
        let Self { positions, has_normals, normals, codes, intensities, looks, decided, classes, counts, .. } = self;
        let (left_out, wants) = (self.left_out, self.wants);
        let normals = has_normals.map(|_| normals);
        let kind = Kind { zero_is_none: !decided, ..Kind::of(Number::WORD) };
        let colors = Numbers { values: Values::Words(codes), kind, alpha: None };
        let (colors, shades) = match looks {
            Some(Looks::Colors) => (Some(colors), None),
            _ => (None, Some(Shades::Words(intensities))),
        };
        let raw = RawColors::of_run(positions.len(), colors, shades);
        let raw = Some(Box::new(RawColors { opacities: options.classes, classes, ..raw }));
        let up = Some(Up::Z);
        let mut points = Points { positions, normals, raw, up, classes: counts, ..Points::default() };
        wants.map_or(Ok(()), |wants| wants.collector.finish(&mut points, false))?;
        points.withheld = left_out.len() as u64 - points.filtered;
        points.left_out = left_out;
        leave_out_unseen(&mut points, numbers);
        Ok(points)
    }

    /// The collected points, with their indices in the file. `runs` are the ranges of indices that
    /// were read, and `all` is the number of points in the file. From 2^32 points on, indices do
    /// not fit in u32, and points are numbered in the order in which they are kept.
    fn numbered(self, runs: &[Range<u64>], all: u64, options: &ReadOptions) -> Result<Points, Fault> {
        let numbers = || runs.iter().cloned().flatten();
        let mut points = self.points(numbers(), options)?;
        let mut left_out = std::mem::take(&mut points.left_out).into_iter().peekable();
        if u32::try_from(all).is_ok() {
            let kept = numbers().filter(|number| left_out.next_if_eq(number).is_none());
            points.numbers = Some(kept.map(|number| number as u32).collect());
        }
        Ok(points)
    }

    /// Adds the points of a block, except deleted ones. `first` is the index of the block's first
    /// point.
    fn take(&mut self, block: &PointData, first: u64, options: &ReadOptions) {
        let mut keeps = Vec::with_capacity(block.len());
        let passes = self.passing(block, options);
        for ((withheld, class), number) in withheld(block).zip(classes(block)).zip(first..) {
            let passes = passes.get(keeps.len()).is_none_or(|passes| *passes);
            let keep = passes && (!withheld || options.keep_withheld);
            if keep {
                *self.counts.entry(class).or_default() += 1;
                self.classes.extend((!options.classes.are_plain()).then_some(class));
            } else {
                self.left_out.push(number);
            }
            keeps.push(keep);
        }
        fn kept<T>(values: impl Iterator<Item = T>, keeps: &[bool]) -> impl Iterator<Item = T> {
            values.zip(keeps).filter_map(|(value, keep)| keep.then_some(value))
        }
        let coordinates = block.x().zip(block.y()).zip(block.z()).map(|((x, y), z)| [x, y, z]);
        self.positions.extend(kept(coordinates, &keeps));
        if let Some(normals) = self.has_normals {
            self.normals.extend(kept(records(block).map(|record| normals.of_record(record)), &keeps));
        }
        if let Some(rgb) = block.rgb().filter(|_| self.looks != Some(Looks::Intensities)) {
            let before = self.codes.len();
            self.codes.extend(kept(rgb.map(|(r, g, b)| [r, g, b]), &keeps));
            if self.looks.is_none() && self.codes[before..].iter().any(|code| *code != [0; 3]) {
                self.looks = Some(Looks::Colors);
                self.intensities = Vec::new();
            }
        }
        if self.looks != Some(Looks::Colors) {
            self.intensities.extend(kept(block.intensity(), &keeps));
        }
    }
}

/// Marks the points whose class has the opacity 0 as left out. They are removed only later, because
/// they count in the decision about the range of colours. `numbers` are the indices of all points
/// that were read.
fn leave_out_unseen(points: &mut Points, numbers: impl Iterator<Item = u64>) {
    let Some(raw) = &mut points.raw else { return };
    let keep: Vec<bool> = raw.classes.iter().map(|class| raw.opacities.of(*class) > 0.0).collect();
    points.unseen = keep.iter().filter(|keep| !**keep).count() as u64;
    if points.unseen == 0 {
        return;
    }
    let mut deleted = std::mem::take(&mut points.left_out).into_iter().peekable();
    let mut kept = keep.iter();
    let is_left_out = |number: &u64| deleted.next_if_eq(number).is_some() || kept.next() == Some(&false);
    points.left_out = numbers.filter(is_left_out).collect();
    raw.keep = Some(keep);
}

/// The records of a block.
fn records(block: &PointData) -> impl Iterator<Item = &[u8]> {
    block.raw_bytes().chunks_exact(block.record_len().max(1))
}

/// Whether each point of a block is marked as deleted: bit 7 of the classification byte, or in the
/// extended formats bit 2 of the byte of flags before it.
fn withheld(block: &PointData) -> impl Iterator<Item = bool> {
    let mask = if block.format().is_extended { 1 << 2 } else { 1 << 7 };
    records(block).map(move |record| record.get(15).is_some_and(|b| b & mask != 0))
}

/// The class of each point: the lower five bits of byte 15, or in the extended formats byte 16.
fn classes(block: &PointData) -> impl Iterator<Item = u8> {
    let (byte, mask) = if block.format().is_extended { (16, 0xff) } else { (15, 0x1f) };
    records(block).map(move |record| record.get(byte).map_or(0, |b| b & mask))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic)]
    use super::*;
    use las::point::Format;
    use las::{Builder, Writer};
    use std::io::Cursor;

    /// A LAZ file without points.
    fn compressed() -> Vec<u8> {
        let mut builder = Builder::from((1, 4));
        builder.point_format = Format::new(0).unwrap();
        builder.point_format.is_compressed = true;
        let writer = Writer::new(Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
        writer.into_inner().unwrap().into_inner()
    }

    #[test]
    fn a_file_of_no_points_may_have_any_chunk_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.laz");
        let mut bytes = compressed();
        let start = u32::from_le_bytes(*bytes[96..].first_chunk().unwrap()) as usize;
        let table = u64::from_le_bytes(*bytes[start..].first_chunk().unwrap()) as usize;
        // A chunk count that would take 64 GiB, and the first bytes of a table for its decoder.
        bytes.truncate(table + 4);
        bytes.extend([0xff; 4]);
        bytes.extend([0x7f; 64]);
        std::fs::write(&path, &bytes).unwrap();
        let points = read(Input::open(&path, None).unwrap(), &ReadOptions::default(), &()).unwrap();
        assert_eq!((points.positions.len(), points.up), (0, Some(Up::Z)));
    }

    /// A decoder's panics are not printed, on whatever thread of its pool they occur; other panics
    /// are. The test starts itself in another process and checks the output of that process.
    #[test]
    fn a_decoders_panic_is_not_printed() {
        const WHOSE: &str = "EPSPLAT_TEST_PANIC";
        fn panic_with(what: &str) {
            panic!("{what}");
        }
        let decoding = || -> Result<(), Fault> {
            rayon::join(|| panic_with("on a thread"), || panic_with("on another, or the same"));
            Ok(())
        };
        if let Ok(whose) = std::env::var(WHOSE) {
            assert!(matches!(deep(decoding), Err(Fault::Malformed(_))));
            if whose == "ours" {
                assert!(std::panic::catch_unwind(|| panic_with("of our own")).is_err());
            }
            return;
        }
        let printed = |whose: &str| {
            let mut command = std::process::Command::new(std::env::current_exe().unwrap());
            command
                .args(["--exact", "io::las::tests::a_decoders_panic_is_not_printed", "--nocapture"])
                .env(WHOSE, whose);
            let output = command.output().unwrap();
            assert!(output.status.success(), "{output:?}");
            let stderr = String::from_utf8(output.stderr).unwrap();
            (stderr.matches("panicked at").count(), stderr)
        };
        assert_eq!(printed("a decoder's"), (0, String::new()));
        let (count, stderr) = printed("ours");
        assert!(count == 1 && stderr.contains("of our own"), "{stderr}");
    }
}
