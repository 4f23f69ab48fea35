//! Layers of a chunk, each of which has one quantity of all its points: those that nobody asks for are not read.

use super::chunks::Scheme;
use crate::io::fault::{Fault, reserve};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::Range;

/// Of a chunk in layers what is needed of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Layers {
    /// The chunk's first bytes: its first point, how many it has, and how long each layer is. The lengths of layers that are left out are 0, as
    /// where all points have what the first one has.
    start: Vec<u8>,
    /// Where the layers lie that are needed, bytes from the chunk's start.
    runs: Vec<Range<u64>>,
}

impl Layers {
    /// Those that are needed of a chunk that begins with these bytes, [`Scheme::start`] of them.
    pub(super) fn of(mut start: Vec<u8>, scheme: &Scheme) -> Self {
        let lengths = start[scheme.record as usize + 4..].as_chunks_mut().0;
        let mut runs: Vec<Range<u64>> = Vec::new();
        let mut at = scheme.start();
        for (length, &needed) in lengths.iter_mut().zip(&scheme.needed) {
            let layer = at..at + u64::from(u32::from_le_bytes(*length));
            at = layer.end;
            match runs.last_mut() {
                _ if !needed => *length = [0; 4],
                Some(run) if run.end == layer.start => run.end = layer.end,
                _ => runs.push(layer),
            }
        }
        Self { start, runs }
    }

    /// Bytes that are read of the chunk.
    pub(super) fn bytes(&self) -> u64 {
        self.start.len() as u64 + self.runs.iter().map(|run| run.end - run.start).sum::<u64>()
    }

    /// The chunk that lies at this place of the file, as if it had no other layers.
    pub(super) fn read(&self, mut file: &File, offset: u64) -> Result<Vec<u8>, Fault> {
        let mut bytes = Vec::new();
        reserve(&mut bytes, self.bytes())?;
        bytes.extend(&self.start);
        for run in &self.runs {
            file.seek(SeekFrom::Start(offset + run.start))?;
            file.take(run.end - run.start).read_to_end(&mut bytes)?;
        }
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::io::Write;

    #[test]
    fn layers_that_are_not_needed_are_not_read() {
        let needed = [true, true, false, false, true, false, true];
        let scheme = Scheme {
            compressor: 3,
            chunk: None,
            record: 2,
            has_color: true,
            needed: needed.to_vec(),
            extra: None,
            intensities: None,
        };
        let lengths = [3u32, 2, 4, 0, 1, 5, 2];
        let mut chunk = vec![7, 8, 9, 0, 0, 0];
        chunk.extend(lengths.iter().flat_map(|length| length.to_le_bytes()));
        let start = chunk.clone();
        chunk.extend(lengths.iter().zip(10u8..).flat_map(|(&length, layer)| vec![layer; length as usize]));
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&[[1; 5].as_slice(), &chunk, &[2; 9]].concat()).unwrap();
        let layers = Layers::of(start, &scheme);
        let read = layers.read(&file, 5).unwrap();
        let kept: Vec<u8> = [3u32, 2, 0, 0, 1, 0, 2].into_iter().flat_map(u32::to_le_bytes).collect();
        assert_eq!(read, [&[7, 8, 9, 0, 0, 0], kept.as_slice(), &[10, 10, 10, 11, 11, 14, 16, 16]].concat());
        assert_eq!(layers.bytes(), read.len() as u64);
    }
}
