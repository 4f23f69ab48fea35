//! What a LAS or LAZ file promises, checked against how long it is, before the decoder allocates what it promises.
//!
//! The decoder takes every length in a file for true: a record's, a chunk's, a layer's. One flipped bit would have it
//! allocate gigabytes, which no error handling survives, so each of these lengths is looked at here first.

use super::arithmetic::Integers;
use super::extra::Field;
use super::shown::Shown;
use crate::io::fault::Fault;
use las::raw::{Header, Vlr};
use std::io::{BufReader, Read, Seek, SeekFrom};

/// A decoded chunk larger than this is decoded by one thread, which needs no buffer for it.
pub(super) const CHUNK_LIMIT: u64 = 1 << 28;

/// No byte is more points than this: at its cheapest a point is a symbol of 64 whose probability is 1 - 63 / 2^15, 0.0028 bits.
pub(super) const MOST_A_BYTE: u64 = 1 << 12;

/// Which layer of a point has its intensity.
const INTENSITIES: usize = 4;

/// Where a LASzip record has the points per chunk.
const CHUNK_SIZE: usize = 12;

/// How a file's points are decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decoding {
    /// Uncompressed, or one chunk after the other.
    Sequential,
    /// Chunks in parallel.
    Parallel,
}

pub(super) fn malformed<T>(what: impl Into<String>) -> Result<T, Fault> {
    Err(Fault::Malformed(what.into()))
}

/// The number of points that the header promises.
pub(super) fn promised(header: &Header) -> u64 {
    match (header.number_of_point_records, header.large_file) {
        (0, Some(large)) => large.number_of_point_records,
        (legacy, _) => u64::from(legacy),
    }
}

/// Checks that every length in the file lies within its `length` bytes, and says how its points can be decoded.
pub(super) fn check(file: &mut BufReader<Shown>, header: &Header, length: u64) -> Result<Decoding, Fault> {
    let start = u64::from(header.offset_to_point_data);
    let record = u64::from(header.point_data_record_length);
    let promised = promised(header);
    if let Some(extended) = &header.evlr {
        let at = extended.start_of_first_evlr;
        if at.saturating_add(60) > length {
            return malformed(format!("it ends at byte {length}, before its extended records at byte {at}"));
        }
        file.seek(SeekFrom::Start(at + 20))?;
        let size = read_u64(file)?;
        if size > length - at - 60 {
            return malformed(format!("an extended record of {size} bytes does not fit in the file"));
        }
    }
    if header.point_data_record_format & 0x80 == 0 {
        let held = length.saturating_sub(start).checked_div(record).unwrap_or(0);
        if held < promised {
            return malformed(format!("the header promises {promised} points, the file ends after {held}"));
        }
        return Ok(Decoding::Sequential);
    }
    let Some((at, laszip)) = laszip_record(file, header)? else {
        return malformed("it is compressed, but has no LASzip record");
    };
    let scheme = Scheme::parse(&laszip).filter(|scheme| scheme.record == record && record > 0);
    let Some(scheme) = scheme else {
        return malformed("its LASzip record does not describe its points");
    };
    if promised == 0 {
        return Ok(Decoding::Sequential);
    }
    if scheme.compressor == 1 {
        if start.saturating_add(record) > length {
            return malformed(format!("{} the first of them", early(promised, length)));
        }
        if promised / MOST_A_BYTE > length {
            return malformed(format!(
                "the header promises {promised} points, more than a file of {length} bytes can hold"
            ));
        }
        // One run of all points has no use for a chunk size, but the decoder takes none at all for a table of chunks.
        file.get_mut().show(at + CHUNK_SIZE as u64, &u32::to_le_bytes(1));
        return Ok(Decoding::Sequential);
    }
    let mut chunks = chunk_table(file, start, length, &scheme, promised)?;
    if scheme.compressor == 3 {
        check_layers(file, start + 8, &scheme, &mut chunks)?;
    }
    let held = chunks.iter().fold(0u64, |sum, chunk| sum.saturating_add(chunk.points));
    if held < promised {
        return malformed(format!("the header promises {promised} points, the file ends after {held}"));
    }
    let largest = chunks.iter().map(|chunk| chunk.points.max(scheme.chunk.map_or(0, u64::from))).max().unwrap_or(0);
    Ok(if largest.saturating_mul(record) > CHUNK_LIMIT { Decoding::Sequential } else { Decoding::Parallel })
}

/// The data of the record that says how the points are compressed, and where it lies.
pub(super) fn laszip_record(file: &mut (impl Read + Seek), header: &Header) -> Result<Option<(u64, Vec<u8>)>, Fault> {
    file.seek(SeekFrom::Start(u64::from(header.header_size)))?;
    for _ in 0..header.number_of_variable_length_records {
        let Ok(record) = Vlr::read_from(&mut *file, false) else {
            return malformed("it ends inside its variable-length records");
        };
        // The very record that the decoder takes: any other could have another follow that nobody checked.
        let name = record.user_id.split(|byte| *byte == 0).next();
        if record.record_id == 22204 && name == Some(b"laszip encoded") {
            return Ok(Some((file.stream_position()? - record.data.len() as u64, record.data)));
        }
    }
    Ok(None)
}

/// How the points are compressed.
#[derive(Debug)]
pub(super) struct Scheme {
    /// 1: one run of points, without chunks; 2: chunks; 3: chunks in layers.
    pub(super) compressor: u16,
    /// Points per chunk; `None` where the chunk table gives them.
    pub(super) chunk: Option<u32>,
    /// Bytes per decoded point.
    pub(super) record: u64,
    /// Whether the decoder knows colours among the layers.
    pub(super) has_color: bool,
    /// Of each layer of a chunk, where chunks are in layers, whether anything is taken of it.
    pub(super) needed: Vec<bool>,
    /// The layer of the first extra byte, where layers are told apart and points have such.
    pub(super) extra: Option<usize>,
    /// The layer of intensities, where layers are told apart and points have colours.
    pub(super) intensities: Option<usize>,
}

impl Scheme {
    pub(super) fn parse(data: &[u8]) -> Option<Self> {
        let u16_at = |at: usize| data.get(at..)?.first_chunk().copied().map(u16::from_le_bytes);
        let chunk = u32::from_le_bytes(data.get(CHUNK_SIZE..)?.first_chunk().copied()?);
        let (compressor, items) = (u16_at(0)?, u16_at(32)?);
        let (mut record, mut layers, mut kinds) = (0, Vec::new(), Vec::new());
        for item in 0..usize::from(items) {
            let (kind, size) = (u16_at(34 + 6 * item)?, u64::from(u16_at(36 + 6 * item)?));
            // Where a size is not the kind's own, the decoder would look for layers elsewhere than they are checked.
            let (own_size, own_layers) = match kind {
                0 => (size, 0),              // extra bytes
                6 => (20, 0),                // point of formats 0 to 5
                7 => (8, 0),                 // time
                8 => (6, 0),                 // colour
                9 => (29, 0),                // wave packet
                10 => (30, 9),               // x and y, z, class, flags, intensity, angle, user data, source, time
                11 => (6, 1),                // colour
                12 => (8, 2),                // colour, near infrared
                13 => (29, 1),               // wave packet
                14 => (size, size as usize), // extra bytes: one layer each
                _ => return None,
            };
            // Nor are layers looked for outside chunks of layers, but the decoder would take their lengths for true.
            if size != own_size || (kind >= 10) != (compressor == 3) {
                return None;
            }
            record += size;
            // The header's own number is as long.
            if record > u64::from(u16::MAX) {
                return None;
            }
            kinds.push(kind);
            layers.extend((0..own_layers).map(|layer| (kind, layer)));
        }
        let has_color = kinds.iter().any(|kind| matches!(kind, 11 | 12));
        // As LAS has points in layers: what is behind a colour is of no matter.
        let usual = kinds.first() == Some(&10) && (!has_color || matches!(kinds.get(1), Some(11 | 12)));
        let needed = |(kind, layer): (u16, usize)| match kind {
            // A point's place, class and flags; and where nothing has a colour intensities are taken for one.
            10 => layer < INTENSITIES || !has_color && layer == INTENSITIES,
            11 | 12 => layer == 0,
            _ => false,
        };
        let intensities = layers.iter().position(|layer| *layer == (10, INTENSITIES)).filter(|_| usual && has_color);
        let extra = layers.iter().position(|layer| *layer == (14, 0)).filter(|_| usual);
        let needed = layers.into_iter().map(|layer| !usual || needed(layer)).collect();
        let chunk = Some(chunk).filter(|&chunk| chunk != 0 && chunk != u32::MAX);
        Some(Self { compressor, chunk, record, has_color, needed, extra, intensities })
    }

    /// Whether the intensities of points with colours are taken, which may all be zero.
    pub(super) fn need_intensities(&mut self, taken: bool) {
        if let Some(needed) = self.intensities.and_then(|layer| self.needed.get_mut(layer)) {
            *needed = taken;
        }
    }

    /// Takes an attribute of the extra bytes, each of which is a layer.
    pub(super) fn need_extra(&mut self, field: &Field) {
        let Some(first) = self.extra else { return };
        let layers = self.needed.iter_mut().skip(first + field.start).take(field.size.into());
        layers.for_each(|needed| *needed = true);
    }

    /// Bytes of a chunk in layers before these: its first point, how many it has, and how long each layer is.
    pub(super) fn start(&self) -> u64 {
        self.record + 4 + 4 * self.needed.len() as u64
    }

    /// The points that a chunk of so many bytes, which begins with these, says that it has; None if its layers do not fit in it.
    pub(super) fn points_in(&self, start: &[u8], bytes: u64) -> Option<u64> {
        let words = start.get(self.record as usize..self.start() as usize)?.as_chunks().0;
        let mut words = words.iter().map(|word| u64::from(u32::from_le_bytes(*word)));
        let count = words.next()?;
        (self.start() + words.sum::<u64>() <= bytes).then_some(count)
    }
}

/// One separately compressed run of points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chunk {
    pub(super) points: u64,
    pub(super) bytes: u64,
}

fn early(promised: u64, length: u64) -> String {
    format!("the header promises {promised} points, but the file ends at byte {length}, before")
}

pub(super) fn chunk_table(
    file: &mut (impl Read + Seek),
    start: u64,
    length: u64,
    scheme: &Scheme,
    promised: u64,
) -> Result<Vec<Chunk>, Fault> {
    let early = early(promised, length);
    if start.saturating_add(8) > length {
        return malformed(format!("{early} the first of them"));
    }
    file.seek(SeekFrom::Start(start))?;
    let mut table = read_u64(file)?;
    if table as i64 <= start as i64 {
        // A writer that could not seek back puts the table's place at the end of the file.
        file.seek(SeekFrom::Start(length - 8))?;
        table = read_u64(file)?;
    }
    if table < start + 8 || table.saturating_add(8) > length {
        return malformed(format!("{early} its chunk table"));
    }
    file.seek(SeekFrom::Start(table))?;
    let count = read_u64(file)? >> 32;
    let available = table - start - 8;
    // A chunk begins with one whole point.
    if count > available / scheme.record {
        return malformed(format!("its chunk table lists {count} chunks, more than the file can hold"));
    }
    let unreadable = || Fault::Malformed("its chunk table cannot be decoded".into());
    let mut chunks = Vec::new();
    if count == 0 {
        return Ok(chunks);
    }
    let mut integers = Integers::new(file, 2).map_err(|_| unreadable())?;
    let (mut points, mut bytes, mut sum) = (0, 0, 0u64);
    for _ in 0..count {
        if scheme.chunk.is_none() {
            points = integers.next(points, 0).map_err(|_| unreadable())?;
        }
        bytes = integers.next(bytes, 1).map_err(|_| unreadable())?;
        let (Ok(held), Ok(bytes)) = (u64::try_from(points), u64::try_from(bytes)) else { return Err(unreadable()) };
        sum += bytes;
        if sum > available {
            return malformed("the chunks of its chunk table do not fit in the file");
        }
        chunks.push(Chunk { points: scheme.chunk.map_or(held, u64::from), bytes });
    }
    Ok(chunks)
}

/// Checks that the layers of each chunk lie within it, and learns from them how full the last chunk is.
fn check_layers(
    file: &mut (impl Read + Seek),
    mut at: u64,
    scheme: &Scheme,
    chunks: &mut [Chunk],
) -> Result<(), Fault> {
    let mut start = vec![0; scheme.start() as usize];
    for (index, chunk) in chunks.iter_mut().enumerate() {
        if chunk.bytes > 0 || chunk.points > 0 {
            file.seek(SeekFrom::Start(at))?;
            let whole = file.read_exact(&mut start).is_ok();
            let Some(count) = scheme.points_in(&start, chunk.bytes).filter(|_| whole) else {
                return malformed(format!("the layers of its chunk {} do not fit in it", index + 1));
            };
            if count > 0 {
                chunk.points = chunk.points.min(count);
            }
        }
        at += chunk.bytes;
    }
    Ok(())
}

fn read_u64(file: &mut impl Read) -> Result<u64, Fault> {
    let mut bytes = [0; 8];
    file.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The data of a LASzip record with these items: kinds and sizes.
    fn record(items: &[(u16, u16)]) -> Vec<u8> {
        let mut data = vec![0; 32];
        data[0] = if items.iter().any(|(kind, _)| *kind >= 10) { 3 } else { 2 };
        data[12..16].copy_from_slice(&50_000u32.to_le_bytes());
        data.extend((items.len() as u16).to_le_bytes());
        data.extend(items.iter().flat_map(|&(kind, size)| [kind, size, 3]).flat_map(u16::to_le_bytes));
        data
    }

    #[test]
    fn layers_are_needed_for_places_classes_and_colors() {
        let needed = |items: &[(u16, u16)]| {
            let scheme = Scheme::parse(&record(items)).unwrap();
            let needed = scheme.needed.iter().enumerate().filter(|(_, needed)| **needed);
            needed.map(|(layer, _)| layer).collect::<Vec<_>>()
        };
        assert_eq!(needed(&[(10, 30), (11, 6), (14, 2)]), [0, 1, 2, 3, 9]);
        assert_eq!(needed(&[(10, 30), (12, 8), (13, 29)]), [0, 1, 2, 3, 9]);
        assert_eq!(needed(&[(10, 30), (14, 6)]), [0, 1, 2, 3, 4]);
        // In another order the decoder takes something else for what is asked for.
        assert_eq!(needed(&[(10, 30), (14, 1), (11, 6)]).len(), 11);
        assert_eq!(needed(&[(14, 1), (10, 30)]).len(), 10);
    }

    #[test]
    fn items_have_the_size_of_their_kind() {
        let scheme = Scheme::parse(&record(&[(10, 30), (12, 8), (14, 5)]));
        assert!(scheme.is_some_and(|scheme| (scheme.record, scheme.needed.len()) == (43, 16)));
        assert!(Scheme::parse(&record(&[(6, 20), (7, 8), (8, 6), (0, 5)])).is_some());
        // Layers and chunks of layers go together.
        let mut without = record(&[(10, 30)]);
        without[0] = 1;
        assert!(Scheme::parse(&without).is_none());
        // Longer than any record, with a layer for each byte.
        assert!(Scheme::parse(&record(&[(14, u16::MAX); 10_000])).is_none());
        for item in [(11, 30), (10, 29), (6, 30), (12, 6), (5, 8), (15, 1)] {
            assert!(Scheme::parse(&record(&[item])).is_none(), "{item:?}");
        }
    }
}
