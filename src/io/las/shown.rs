//! A LAS file as the decoder is shown it: valid headers that it does not know as those that it does.

use crate::io::fault::Fault;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

/// Where a header has its version, its point format, and how many points there are by the count of
/// LAS 1.0 to 1.3 and by that of 1.4.
const VERSION: u64 = 24;
const FORMAT: usize = 104;
const LEGACY_COUNTS: u64 = 107;
const COUNT: usize = 247;
/// Bytes up to the end of that of 1.4.
const COUNTS_END: u64 = 255;
/// Bytes of those counts: of all points, and of five returns.
const LEGACY_COUNTS_SIZE: usize = 24;

/// A file of which a few bytes read as others.
#[derive(Debug)]
pub(super) struct Shown {
    file: File,
    at: u64,
    /// Places and bytes.
    others: Vec<(u64, Vec<u8>)>,
    /// The count of points of LAS 1.0 to 1.3, as the file has it; that of LAS 1.5 is none.
    pub(super) legacy: u32,
}

impl Shown {
    /// The file from its start. One of LAS 1.5 is shown as of 1.4, whose header is the same but for
    /// times at its end, and without the counts that 1.5 does away with; so is one of 1.4 whose
    /// point format is 6 or above, for which these have no meaning, if it has another count. A
    /// version that is none of 1.0 to 1.5 is refused.
    pub(super) fn new(mut file: File) -> Result<Self, Fault> {
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
                    format!("it is LAS {major}.{minor}, of which only 1.0 to 1.5 are read; convert it to one of these");
                return Err(Fault::Malformed(what));
            }
            // What is too short or no LAS file is refused by its reader.
            _ => {}
        }
        Ok(shown)
    }

    /// The file as it is.
    pub(super) fn into_file(self) -> File {
        self.file
    }

    /// Lets `bytes` be read at `at` from now on.
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
