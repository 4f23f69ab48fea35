//! Chunks that consist of layers. Each layer holds one quantity of all points; only needed layers
//! are read.

use super::chunks::{Chunk, Scheme, malformed};
use super::shown::Shown;
use crate::io::fault::{Fault, reserve};
use crate::io::source::Source;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::ops::Range;

/// Chunks of a remote file with fewer bytes than this are received whole when their heads are
/// checked, as requests for the heads alone would take longer. They are kept for the decoder unless
/// the file is large.
const SMALL: u64 = 1 << 16;

/// Bytes of the chunks of a remote file whose heads are received together.
const LOOKED_AT: u64 = 1 << 24;

/// The part of a chunk that is needed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Layers {
    /// The head of the chunk: its first point, its number of points, and the length of each layer.
    /// Layers that are not needed have the length 0, which means that all points have the first
    /// point's value.
    start: Vec<u8>,
    /// The needed layers, as ranges of bytes from the start of the chunk.
    runs: Vec<Range<u64>>,
}

impl Layers {
    /// Selects the needed layers of a chunk. `start` is its head, [`Scheme::start`] bytes.
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

    /// Bytes of the chunk that are read.
    pub(super) fn bytes(&self) -> u64 {
        self.start.len() as u64 + self.runs.iter().map(|run| run.end - run.start).sum::<u64>()
    }

    /// The ranges of bytes that are read of a chunk at this offset of the file, without its head.
    pub(super) fn ranges(&self, offset: u64) -> impl Iterator<Item = Range<u64>> {
        self.runs.iter().map(move |run| offset + run.start..offset + run.end)
    }

    /// Reads the chunk at this offset of the file as if it had no other layers.
    pub(super) fn read(&self, file: &Source, offset: u64) -> Result<Vec<u8>, Fault> {
        let mut bytes = Vec::new();
        reserve(&mut bytes, self.bytes())?;
        bytes.extend(&self.start);
        for run in &self.runs {
            file.read_at(offset + run.start, run.end - run.start, &mut bytes)?;
        }
        Ok(bytes)
    }
}

/// Checks that the layers of each chunk lie within it. Also limits each chunk's number of points to
/// that in its head, because the last chunk may be shorter.
pub(super) fn check_layers(
    file: &mut BufReader<Shown>,
    mut at: u64,
    scheme: &Scheme,
    chunks: &mut [Chunk],
) -> Result<(), Fault> {
    let mut start = vec![0; scheme.start() as usize];
    let mut expected = at;
    for index in 0..chunks.len() {
        if at >= expected {
            expected = expect_starts(file.get_ref().source(), at, &chunks[index..], scheme)?;
        }
        let chunk = &mut chunks[index];
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

/// Receives the heads of the next chunks, the first of which is at this offset, from a server.
/// Returns the end of these chunks.
fn expect_starts(source: &Source, at: u64, chunks: &[Chunk], scheme: &Scheme) -> Result<u64, Fault> {
    let (mut end, mut starts) = (at, Vec::new());
    for chunk in chunks {
        if end >= at + LOOKED_AT {
            break;
        }
        starts.push(end..end + scheme.start());
        end += chunk.bytes;
    }
    if end - at < SMALL * starts.len() as u64 {
        source.expect(std::iter::once(at..end))?;
    } else {
        source.expect(starts)?;
    }
    Ok(end.max(at + 1))
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
            wants_intensities: false,
        };
        let lengths = [3u32, 2, 4, 0, 1, 5, 2];
        let mut chunk = vec![7, 8, 9, 0, 0, 0];
        chunk.extend(lengths.iter().flat_map(|length| length.to_le_bytes()));
        let start = chunk.clone();
        chunk.extend(lengths.iter().zip(10u8..).flat_map(|(&length, layer)| vec![layer; length as usize]));
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&[[1; 5].as_slice(), &chunk, &[2; 9]].concat()).unwrap();
        let layers = Layers::of(start, &scheme);
        let read = layers.read(&Source::File(file), 5).unwrap();
        let kept: Vec<u8> = [3u32, 2, 0, 0, 1, 0, 2].into_iter().flat_map(u32::to_le_bytes).collect();
        assert_eq!(read, [&[7, 8, 9, 0, 0, 0], kept.as_slice(), &[10, 10, 10, 11, 11, 14, 16, 16]].concat());
        assert_eq!(layers.bytes(), read.len() as u64);
    }
}
