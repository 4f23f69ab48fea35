//! Checks the lengths in a LAS or LAZ file against the size of the file, before the decoder
//! allocates memory of these lengths.
//!
//! The decoder trusts all lengths in a file: of records, chunks and layers. One flipped bit could
//! make it allocate gigabytes, and no error handling survives that, so each length is checked here
//! first.

use super::arithmetic::Integers;
use super::dimensions::Layer;
use super::extra::Field;
use super::layers::check_layers;
use super::shown::Shown;
use crate::io::fault::Fault;
use las::raw::{Header, Vlr};
use std::io::{BufReader, Read, Seek, SeekFrom};

/// Largest chunk that is decoded in parallel with others, bytes after decoding. A file with a
/// larger chunk is decoded by one thread, which needs no buffer for the chunk.
pub(super) const CHUNK_LIMIT: u64 = 1 << 28;

/// Upper bound of the points in a compressed byte. The cheapest point is one symbol, of 64 possible
/// ones, with the probability 1 - 63 / 2^15: it takes 0.0028 bits.
pub(super) const MOST_A_BYTE: u64 = 1 << 12;

/// Index of the layer of intensities among those of a point.
const INTENSITIES: usize = 4;

/// The number of layers of a point without its colour and its extra bytes.
const POINT_LAYERS: usize = 9;

/// Offset of the points per chunk in a LASzip record, bytes.
const CHUNK_SIZE: usize = 12;

/// How the points of a file are decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decoding {
    /// In order: points are uncompressed, or chunks are decoded one by one.
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

/// Checks that all lengths lie within the `length` bytes of the file; chooses how to decode it.
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
        // Without chunks, the chunk size may be 0. The decoder would take that for chunks of
        // variable size and read their table, so it gets a 1 to read.
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

/// Finds the record that says how points are compressed; returns its data and their offset.
pub(super) fn laszip_record(file: &mut (impl Read + Seek), header: &Header) -> Result<Option<(u64, Vec<u8>)>, Fault> {
    file.seek(SeekFrom::Start(u64::from(header.header_size)))?;
    for _ in 0..header.number_of_variable_length_records {
        let Ok(record) = Vlr::read_from(&mut *file, false) else {
            return malformed("it ends inside its variable-length records");
        };
        // The condition must be the decoder's own: otherwise the decoder could use another record,
        // which was not checked.
        let name = record.user_id.split(|byte| *byte == 0).next();
        if record.record_id == 22204 && name == Some(b"laszip encoded") {
            return Ok(Some((file.stream_position()? - record.data.len() as u64, record.data)));
        }
    }
    Ok(None)
}

/// The compression of the points.
#[derive(Debug)]
pub(super) struct Scheme {
    /// 1: points without chunks; 2: chunks; 3: chunks of layers.
    pub(super) compressor: u16,
    /// Points per chunk; `None` if the chunk table gives them.
    pub(super) chunk: Option<u32>,
    /// Size of a decoded point, bytes.
    pub(super) record: u64,
    /// Whether the layers include colours that the decoder knows.
    pub(super) has_color: bool,
    /// Whether each layer of a chunk is needed; empty unless chunks consist of layers.
    pub(super) needed: Vec<bool>,
    /// Index of the layer of the first extra byte, if there are extra bytes and layers are in the
    /// usual order.
    pub(super) extra: Option<usize>,
    /// Index of the layer of intensities, if there are colours and layers are in the usual order.
    pub(super) intensities: Option<usize>,
    /// Whether intensities are needed for themselves, whatever the colours.
    pub(super) wants_intensities: bool,
}

impl Scheme {
    pub(super) fn parse(data: &[u8]) -> Option<Self> {
        let u16_at = |at: usize| data.get(at..)?.first_chunk().copied().map(u16::from_le_bytes);
        let chunk = u32::from_le_bytes(data.get(CHUNK_SIZE..)?.first_chunk().copied()?);
        let (compressor, items) = (u16_at(0)?, u16_at(32)?);
        let (mut record, mut layers, mut kinds) = (0, Vec::new(), Vec::new());
        for item in 0..usize::from(items) {
            let (kind, size) = (u16_at(34 + 6 * item)?, u64::from(u16_at(36 + 6 * item)?));
            // If an item differed in size from its kind, the decoder would find layers that were
            // not checked.
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
            // Items with layers are valid only in chunks of layers: elsewhere the lengths of layers
            // are not checked.
            if size != own_size || (kind >= 10) != (compressor == 3) {
                return None;
            }
            record += size;
            // The header's own record length has 16 bits.
            if record > u64::from(u16::MAX) {
                return None;
            }
            kinds.push(kind);
            layers.extend((0..own_layers).map(|layer| (kind, layer)));
        }
        let has_color = kinds.iter().any(|kind| matches!(kind, 11 | 12));
        // The usual order in LAS files: a point, then its colour; what follows does not matter.
        let usual = kinds.first() == Some(&10) && (!has_color || matches!(kinds.get(1), Some(11 | 12)));
        let needed = |(kind, layer): (u16, usize)| match kind {
            // A point's position, class and flags are needed, and its intensity if there are no
            // colours.
            10 => layer < INTENSITIES || !has_color && layer == INTENSITIES,
            11 | 12 => layer == 0,
            _ => false,
        };
        let intensities = layers.iter().position(|layer| *layer == (10, INTENSITIES)).filter(|_| usual && has_color);
        let extra = layers.iter().position(|layer| *layer == (14, 0)).filter(|_| usual);
        let needed = layers.into_iter().map(|layer| !usual || needed(layer)).collect();
        let chunk = Some(chunk).filter(|&chunk| chunk != 0 && chunk != u32::MAX);
        Some(Self { compressor, chunk, record, has_color, needed, extra, intensities, wants_intensities: false })
    }

    /// Sets whether intensities are needed although there are colours: these may turn out to be all
    /// zero.
    pub(super) fn need_intensities(&mut self, taken: bool) {
        if let Some(needed) = self.intensities.and_then(|layer| self.needed.get_mut(layer)) {
            *needed = taken || self.wants_intensities;
        }
    }

    /// Marks a layer as needed. If layers are in an unusual order, all are needed anyway.
    pub(super) fn need_layer(&mut self, layer: Layer) {
        let place = match layer {
            Layer::Point(place) => place,
            Layer::Color => POINT_LAYERS,
            Layer::Infrared => POINT_LAYERS + 1,
        };
        if let Some(needed) = self.needed.get_mut(place) {
            *needed = true;
        }
        self.wants_intensities |= layer == Layer::Point(INTENSITIES);
    }

    /// Marks an attribute of the extra bytes as needed; each of its bytes is a layer.
    pub(super) fn need_extra(&mut self, field: &Field) {
        let Some(first) = self.extra else { return };
        let layers = self.needed.iter_mut().skip(first + field.start).take(field.size.into());
        layers.for_each(|needed| *needed = true);
    }

    /// Size of the head of a chunk of layers, bytes: its first point, its number of points, and the
    /// length of each layer.
    pub(super) fn start(&self) -> u64 {
        self.record + 4 + 4 * self.needed.len() as u64
    }

    /// The number of points that the head `start` of a chunk states; None if the layers do not fit
    /// in the `bytes` bytes of the chunk.
    pub(super) fn points_in(&self, start: &[u8], bytes: u64) -> Option<u64> {
        let words = start.get(self.record as usize..self.start() as usize)?.as_chunks().0;
        let mut words = words.iter().map(|word| u64::from(u32::from_le_bytes(*word)));
        let count = words.next()?;
        (self.start() + words.sum::<u64>() <= bytes).then_some(count)
    }
}

/// Points that are compressed independently of all others.
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
        // A writer that cannot seek back puts the offset of the table at the end of the file.
        file.seek(SeekFrom::Start(length - 8))?;
        table = read_u64(file)?;
    }
    if table < start + 8 || table.saturating_add(8) > length {
        return malformed(format!("{early} its chunk table"));
    }
    file.seek(SeekFrom::Start(table))?;
    let count = read_u64(file)? >> 32;
    let available = table - start - 8;
    // Each chunk starts with one uncompressed point.
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

fn read_u64(file: &mut impl Read) -> Result<u64, Fault> {
    let mut bytes = [0; 8];
    file.read_exact(&mut bytes)?;
    Ok(u64::from_le_bytes(bytes))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The data of a LASzip record with these items, given as kind and size.
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
        // In another order the decoder would select the wrong layers.
        assert_eq!(needed(&[(10, 30), (14, 1), (11, 6)]).len(), 11);
        assert_eq!(needed(&[(14, 1), (10, 30)]).len(), 10);
    }

    #[test]
    fn items_have_the_size_of_their_kind() {
        let scheme = Scheme::parse(&record(&[(10, 30), (12, 8), (14, 5)]));
        assert!(scheme.is_some_and(|scheme| (scheme.record, scheme.needed.len()) == (43, 16)));
        assert!(Scheme::parse(&record(&[(6, 20), (7, 8), (8, 6), (0, 5)])).is_some());
        // Layers and chunks of layers only occur together.
        let mut without = record(&[(10, 30)]);
        without[0] = 1;
        assert!(Scheme::parse(&without).is_none());
        // Longer than any record, with one layer per byte.
        assert!(Scheme::parse(&record(&[(14, u16::MAX); 10_000])).is_none());
        for item in [(11, 30), (10, 29), (6, 30), (12, 6), (5, 8), (15, 1)] {
            assert!(Scheme::parse(&record(&[item])).is_none(), "{item:?}");
        }
    }
}
