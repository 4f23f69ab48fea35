//! Adapts the header of a LAS file to the decoder. Valid headers that the decoder does not know are
//! shown as similar headers that it knows.

use crate::io::fault::Fault;
use crate::io::source::Source;
use std::io::{self, Read, Seek, SeekFrom};

/// Offsets in the header, bytes: the version, the point format, and the point counts of LAS 1.0 to
/// 1.3 and of 1.4.
const VERSION: u64 = 24;
const FORMAT: usize = 104;
const LEGACY_COUNTS: u64 = 107;
const COUNT: usize = 247;
/// End of the point count of LAS 1.4, bytes.
const COUNTS_END: u64 = 255;
/// Size of the counts of LAS 1.0 to 1.3, bytes: of all points, and of five returns.
const LEGACY_COUNTS_SIZE: usize = 24;

/// A file in which a few bytes are replaced when they are read.
#[derive(Debug)]
pub(super) struct Shown {
    file: Source,
    at: u64,
    /// The replacement bytes, and their offsets.
    others: Vec<(u64, Vec<u8>)>,
    /// The file's own point count in the field of LAS 1.0 to 1.3; 0 for LAS 1.5, which has none.
    pub(super) legacy: u32,
}

impl Shown {
    /// Reads the file from its beginning, with a header that the decoder knows.
    ///
    /// LAS 1.5 is shown as LAS 1.4, whose header differs only by times at its end. Legacy counts
    /// are shown as 0: version 1.5 abolished them. They are also shown as 0 in LAS 1.4 with a point
    /// format of 6 or above, where they have no meaning, if the count of LAS 1.4 is not 0. Versions
    /// other than 1.0 to 1.5 are refused.
    pub(super) fn new(mut file: Source) -> Result<Self, Fault> {
        let mut start = Vec::new();
        (&mut file).take(COUNTS_END).read_to_end(&mut start)?;
        file.rewind()?;
        let legacy = start.get(LEGACY_COUNTS as usize..).and_then(|rest| rest.first_chunk());
        let legacy = legacy.map_or(0, |bytes| u32::from_le_bytes(*bytes));
        let mut shown = Self { file, at: 0, others: Vec::new(), legacy };
        let is_extended = start.get(FORMAT).is_some_and(|format| format & 0x3f >= 6);
        let has_count = start.get(COUNT..).is_some_and(|count| count.iter().any(|byte| *byte > 0));
        match start.get(VERSION as usize..VERSION as usize + 2) {
            Some(&[1, 5]) if start.starts_with(b"LASF") => {
                shown.show(VERSION, &[1, 4]);
                shown.show(LEGACY_COUNTS, &[0; LEGACY_COUNTS_SIZE]);
                shown.legacy = 0;
            }
            Some(&[1, 4]) if is_extended && has_count => shown.show(LEGACY_COUNTS, &[0; LEGACY_COUNTS_SIZE]),
            Some(&[1, 0..5]) => {}
            Some(&[major, minor]) if start.starts_with(b"LASF") => {
                let what =
                    format!("it is LAS {major}.{minor}, but only 1.0 to 1.5 can be read; convert it to one of these");
                return Err(Fault::Malformed(what));
            }
            // Files that are too short or not LAS are refused by their reader.
            _ => {}
        }
        Ok(shown)
    }

    /// The file, whose bytes are not replaced.
    pub(super) fn source(&self) -> &Source {
        &self.file
    }

    /// The unmodified file.
    pub(super) fn into_source(self) -> Source {
        self.file
    }

    /// Shows `bytes` at the offset `at` from now on.
    pub(super) fn show(&mut self, at: u64, bytes: &[u8]) {
        self.others.push((at, bytes.to_vec()));
    }
}

impl Read for Shown {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(out)?;
        for (place, bytes) in &self.others {
            for (byte, place) in bytes.iter().zip(*place..) {
                let index = place.checked_sub(self.at).and_then(|index| usize::try_from(index).ok());
                if let Some(out) = index.and_then(|index| out[..count].get_mut(index)) {
                    *out = *byte;
                }
            }
        }
        self.at += count as u64;
        Ok(count)
    }
}

impl Seek for Shown {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.file.seek(to)?;
        Ok(self.at)
    }
}
