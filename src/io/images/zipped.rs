//! Archives of arrays (`.npz`): a ZIP file of `.npy` files without compression.
//!
//! Every entry has the fields of ZIP64, as NumPy writes them, so arrays may exceed 4 GiB.

use std::io::{self, Write};

use super::array::Array;
use super::{Image, Sink};

/// The version of ZIP that a reader needs for ZIP64: 4.5.
const VERSION: u16 = 45;

/// The value of a 32-bit field whose number is among the fields of ZIP64.
const ELSEWHERE: u32 = u32::MAX;

/// 1 January 1980, in the format of MS-DOS. The time of writing would make equal frames differ.
const DATE: u16 = 0x21;

pub(super) fn encode(sink: &mut dyn Sink, image: &Image<'_>) -> io::Result<()> {
    let frame = image.frame;
    let maps = frame.maps().iter().map(|map| (map.row().name, Array::of_map(frame, map)));
    let arrays = [("color", Array::of_color(frame))].into_iter().chain(maps);
    let entries = arrays.map(|(name, array)| Entry::write(sink, name, &array)).collect::<io::Result<Vec<_>>>()?;
    directory(sink, &entries)
}

/// A file of the archive.
struct Entry {
    name: String,
    size: u64,
    crc: u32,
    /// Where the local header begins, bytes.
    start: u64,
}

impl Entry {
    /// Writes a local header and the file behind it.
    fn write(sink: &mut dyn Sink, name: &str, array: &Array<'_>) -> io::Result<Self> {
        // The checksum stands before the data, so the data are produced twice.
        let mut sum = Sum(crc32fast::Hasher::new());
        array.write(&mut sum)?;
        let start = sink.stream_position()?;
        let entry = Self { name: format!("{name}.npy"), size: array.size(), crc: sum.0.finalize(), start };
        let mut header = 0x0403_4b50u32.to_le_bytes().to_vec();
        entry.common(&mut header, 20);
        header.extend(entry.name.as_bytes());
        extra(&mut header, &[entry.size, entry.size]);
        sink.write_all(&header)?;
        array.write(sink)?;
        Ok(entry)
    }

    /// Appends the fields that the local header and the directory share. `extra` is the size of the
    /// fields of ZIP64, bytes.
    fn common(&self, header: &mut Vec<u8>, extra: u16) {
        let [flags, method, time] = [0u16; 3];
        for field in [VERSION, flags, method, time, DATE] {
            header.extend(field.to_le_bytes());
        }
        for field in [self.crc, ELSEWHERE, ELSEWHERE] {
            header.extend(field.to_le_bytes());
        }
        header.extend((self.name.len() as u16).to_le_bytes());
        header.extend(extra.to_le_bytes());
    }
}

/// Appends the fields of ZIP64.
fn extra(header: &mut Vec<u8>, fields: &[u64]) {
    header.extend(1u16.to_le_bytes());
    header.extend((8 * fields.len() as u16).to_le_bytes());
    fields.iter().for_each(|field| header.extend(field.to_le_bytes()));
}

/// Writes the central directory and the records that end the archive.
fn directory(sink: &mut dyn Sink, entries: &[Entry]) -> io::Result<()> {
    let start = sink.stream_position()?;
    let mut bytes = Vec::new();
    for entry in entries {
        bytes.extend(0x0201_4b50u32.to_le_bytes());
        bytes.extend(VERSION.to_le_bytes());
        entry.common(&mut bytes, 28);
        // No comment, the first disk, no attributes.
        bytes.extend([0; 10]);
        bytes.extend(ELSEWHERE.to_le_bytes());
        bytes.extend(entry.name.as_bytes());
        extra(&mut bytes, &[entry.size, entry.size, entry.start]);
    }
    let (size, count) = (bytes.len() as u64, entries.len() as u64);
    let end = start + size;
    bytes.extend(0x0606_4b50u32.to_le_bytes());
    bytes.extend(44u64.to_le_bytes());
    bytes.extend([VERSION.to_le_bytes(), VERSION.to_le_bytes()].as_flattened());
    bytes.extend([0; 8]);
    [count, count, size, start].iter().for_each(|field| bytes.extend(field.to_le_bytes()));
    // The locator of that record.
    bytes.extend(0x0706_4b50u32.to_le_bytes());
    bytes.extend(0u32.to_le_bytes());
    bytes.extend(end.to_le_bytes());
    bytes.extend(1u32.to_le_bytes());
    bytes.extend(0x0605_4b50u32.to_le_bytes());
    bytes.extend([0; 4]);
    [count as u16; 2].iter().for_each(|field| bytes.extend(field.to_le_bytes()));
    [ELSEWHERE; 2].iter().for_each(|field| bytes.extend(field.to_le_bytes()));
    bytes.extend([0; 2]);
    sink.write_all(&bytes)
}

/// Computes the checksum of what is written.
struct Sum(crc32fast::Hasher);

impl Write for Sum {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
