//! Reads a damaged file chunk by chunk, and leaves out the chunks that cannot be decoded.

use super::chunks::{CHUNK_LIMIT, Chunk, MOST_A_BYTE, Scheme, chunk_table, laszip_record, malformed, promised};
use super::shown::Shown;
use super::{Kept, described, early, header, of_las, shape_of};
use crate::Progress;
use crate::io::fault::{self, Fault, Unread, reserve, surviving};
use crate::io::source::Source;
use crate::io::{Points, ReadOptions};
use las::{PointData, PointDataBuilder, raw};
use laz::LazVlr;
use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use rayon::prelude::*;
use std::io::{BufReader, Cursor, Seek};
use std::path::Path;

/// A chunk, and where it is in the file.
struct Place {
    /// Counted from 1.
    number: usize,
    /// Offset from the start of the file, bytes.
    offset: u64,
    bytes: u64,
    /// Index of its first point.
    first: u64,
    points: u64,
}

/// Reads the points of all chunks that can be decoded, of a file whose chunk table is intact. Fails
/// if no chunk can be decoded, or if all can: then the damage is elsewhere.
pub(super) fn read(
    (mut file, length): (Source, u64),
    path: &Path,
    options: &ReadOptions,
    progress: &dyn Progress,
) -> Result<Points, Fault> {
    file.rewind()?;
    let mut shown = BufReader::new(Shown::new(file)?);
    let (legacy, name) = (shown.get_ref().legacy, fault::name(path));
    let header = raw::Header::read_from(&mut shown).map_err(of_las)?;
    let laszip = laszip_record(&mut shown, &header)?.map(|(_, data)| data).unwrap_or_default();
    let record = u64::from(header.point_data_record_length);
    let scheme = Scheme::parse(&laszip).filter(|scheme| scheme.record == record && record > 0);
    let Some(scheme) = scheme.filter(|scheme| scheme.compressor > 1) else { return malformed("it has no chunks") };
    let (format, transforms) = shape_of(&header)?;
    let start = u64::from(header.offset_to_point_data);
    let table = chunk_table(&mut shown, start, length, &scheme, promised(&header))?;
    let places = places(&table, start + 8, promised(&header))?;
    let found = header::look(&mut shown, (&header, legacy), (length, &name)).map_err(early)?;
    let vlr = LazVlr::from_buffer(&laszip).map_err(|error| of_las(error.into()))?;
    let builder = PointDataBuilder::new().with_format(format).with_transforms(transforms);
    let (file, mut unread, mut read) = (shown.into_inner().into_source(), Unread::default(), Vec::new());
    let normals = found.normals.clone();
    let mut kept = Kept::of(None, normals.as_ref());
    kept.wants = found.dimensions.collector(&options.wanted)?;
    progress.begin(&format!("reading {name}, chunk by chunk"), promised(&header));
    for together in places.chunks(rayon::current_num_threads()) {
        file.expect(together.iter().map(|place| place.offset..place.offset + place.bytes))?;
        let bytes: Vec<Result<Vec<u8>, Fault>> = together.iter().map(|place| bytes_of(&file, place)).collect();
        let decode = |(place, bytes): (&Place, Result<Vec<u8>, Fault>)| {
            let records = surviving(|| decoded(place, &bytes?, &scheme, &vlr))?;
            builder.clone().build_from_bytes(records).map_err(of_las)
        };
        let blocks: Vec<Result<PointData, Fault>> = together.par_iter().zip(bytes).map(decode).collect();
        for (place, block) in together.iter().zip(blocks) {
            match block {
                Ok(block) => {
                    kept.take(&block, place.first, options);
                    read.push(place.first..place.first + place.points);
                }
                Err(fault) => {
                    unread.add(|what| format!("chunk {}: {what}", place.number), place.points, fault, false)?;
                }
            }
            progress.advance(place.points);
        }
    }
    progress.end();
    if unread.is_empty() {
        return malformed("all chunks can be decoded");
    }
    let unread = unread.told(path, ("chunks", places.len() as u64), !read.is_empty())?;
    let points = kept.numbered(&read, promised(&header), options)?;
    Ok(Points { unread, ..described(points, found, &name, options) })
}

/// Where the chunks of a table are in the file; the first is at `offset`. All chunks together are
/// cut to the `promised` points, because a table of equal chunks gives the last one the full size.
/// Fails if the chunks hold fewer points.
fn places(table: &[Chunk], mut offset: u64, promised: u64) -> Result<Vec<Place>, Fault> {
    let (mut places, mut first) = (Vec::new(), 0);
    for (index, &Chunk { points, bytes }) in table.iter().enumerate() {
        let points = points.min(promised - first);
        if points > 0 {
            places.push(Place { number: index + 1, offset, bytes, first, points });
        }
        (offset, first) = (offset + bytes, first + points);
    }
    if first == promised { Ok(places) } else { malformed("its chunks hold fewer points than its header promises") }
}

fn bytes_of(file: &Source, place: &Place) -> Result<Vec<u8>, Fault> {
    let mut bytes = Vec::new();
    reserve(&mut bytes, place.bytes)?;
    file.read_at(place.offset, place.bytes, &mut bytes)?;
    Ok(bytes)
}

/// Decodes the records of a chunk. Its lengths are checked first, as the decoder trusts them.
fn decoded(place: &Place, bytes: &[u8], scheme: &Scheme, vlr: &LazVlr) -> Result<Vec<u8>, Fault> {
    let size = place.points.saturating_mul(scheme.record);
    if place.points / MOST_A_BYTE > bytes.len() as u64 || size > CHUNK_LIMIT {
        return malformed("it has more points than its bytes can hold, or than can be decoded at once");
    }
    let failed = |error: laz::LasZipError| early(of_las(error.into()));
    let mut records = Vec::new();
    reserve(&mut records, size)?;
    records.resize(size as usize, 0);
    let done = if scheme.compressor == 3 {
        match scheme.points_in(bytes, bytes.len() as u64) {
            Some(points) if points == place.points => {}
            Some(points) => {
                return malformed(format!("it says that it has {points} points, but its table {}", place.points));
            }
            None => return malformed("its layers do not fit in it"),
        }
        let mut decompressor = LayeredPointRecordDecompressor::new(Cursor::new(bytes));
        decompressor.set_fields_from(vlr.items()).map_err(failed)?;
        decompressor.decompress_many(&mut records)
    } else {
        let mut decompressor = SequentialPointRecordDecompressor::new(Cursor::new(bytes));
        decompressor.set_fields_from(vlr.items()).map_err(failed)?;
        decompressor.decompress_many(&mut records)
    };
    done.map_err(|error| early(Fault::Io(error)))?;
    Ok(records)
}
