//! Reads and writes some words of a buffer: runs that lie apart, so that the rest of the buffer
//! costs nothing. A buffer that the host can map is used where it lies. Others are copied run by
//! run through a staging buffer.

use std::borrow::Cow;
use std::ops::Range;

use super::buffers::{Buffer, PIECE};
use super::device::Gpu;
use super::traffic::Traffic;
use crate::error::Result;

/// Bytes of a word.
const WORD: u64 = 4;

/// Cuts runs of records, `record` words each, so that each piece fits a staging buffer.
pub(crate) fn cut(runs: impl IntoIterator<Item = Range<u64>>, record: u64) -> Vec<Range<u64>> {
    let most = (PIECE / WORD / record.max(1)).max(1) * record.max(1);
    let pieces = |run: Range<u64>| {
        let (first, end) = (run.start, run.end);
        (first..end).step_by(most as usize).map(move |start| start..end.min(start + most))
    };
    runs.into_iter().flat_map(pieces).collect()
}

impl Buffer<u32> {
    /// Calls `each` with the words of every run, in order. `runs` ascend and lie apart, and each
    /// fits a staging buffer ([`cut`]).
    pub(crate) fn visit_runs(
        &self,
        gpu: &Gpu,
        runs: &[Range<u64>],
        mut each: impl FnMut(Range<u64>, &[u32]),
    ) -> Result<()> {
        let lies_open = self.raw.usage().contains(wgpu::BufferUsages::MAP_READ);
        for runs in batches(runs, lies_open) {
            let (Some(first), Some(last)) = (runs.first(), runs.last()) else { continue };
            let copied = copied_bytes(runs);
            Traffic::count(Traffic { bytes_read: copied, ..Traffic::default() });
            let staging;
            // The buffer, its words that are mapped, and where in them each run starts.
            let (buffer, size) = match lies_open {
                true => (&self.raw, (last.end - first.start) * WORD),
                false => {
                    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
                    staging = staged(gpu, copied, usage, false);
                    let mut encoder = gpu.encoder();
                    for (at, run) in placed(runs) {
                        let (from, bytes) = (run.start * WORD, (run.end - run.start) * WORD);
                        encoder.copy_buffer_to_buffer(&self.raw, from, &staging, at * WORD, bytes);
                    }
                    gpu.submit(encoder);
                    (&staging, copied)
                }
            };
            let offset = if lies_open { first.start * WORD } else { 0 };
            // Mapped ranges begin at multiples of 8 bytes.
            let skipped = offset % wgpu::MAP_ALIGNMENT;
            let slice = buffer.slice(offset - skipped..offset + size);
            gpu.check()?;
            slice.map_async(wgpu::MapMode::Read, |_| {});
            gpu.wait().inspect_err(|_| buffer.unmap())?;
            let view = slice.get_mapped_range().map_err(|e| gpu.error(format!("reading back failed: {e}")))?;
            for (at, run) in placed(runs) {
                let at = if lies_open { run.start - first.start } else { at };
                let bytes = (skipped + at * WORD) as usize..(skipped + (at + run.end - run.start) * WORD) as usize;
                each(run, &words(&view[bytes]));
            }
            drop(view);
            buffer.unmap();
        }
        Ok(())
    }

    /// Overwrites every run with the words that `each` returns for it. `runs` are those of
    /// [`Buffer::visit_runs`].
    pub(crate) fn write_runs<'a>(
        &self,
        gpu: &Gpu,
        runs: &[Range<u64>],
        each: impl Fn(Range<u64>) -> Cow<'a, [u32]>,
    ) -> Result<()> {
        let lies_open = self.raw.usage().contains(wgpu::BufferUsages::MAP_WRITE);
        for runs in batches(runs, lies_open) {
            let (Some(first), Some(last)) = (runs.first(), runs.last()) else { continue };
            let copied = copied_bytes(runs);
            Traffic::count(Traffic { bytes_written: copied, ..Traffic::default() });
            let staging;
            let (buffer, offset, size) = match lies_open {
                true => (&self.raw, first.start * WORD, (last.end - first.start) * WORD),
                false => {
                    let usage = wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC;
                    staging = staged(gpu, copied, usage, true);
                    (&staging, 0, copied)
                }
            };
            let skipped = offset % wgpu::MAP_ALIGNMENT;
            let slice = buffer.slice(offset - skipped..offset + size);
            if lies_open {
                gpu.check()?;
                slice.map_async(wgpu::MapMode::Write, |_| {});
                gpu.wait().inspect_err(|_| buffer.unmap())?;
            }
            let mut view = slice.get_mapped_range_mut().map_err(|e| gpu.error(format!("writing failed: {e}")))?;
            for (at, run) in placed(runs) {
                let at = if lies_open { run.start - first.start } else { at };
                let words = each(run);
                let start = (skipped + at * WORD) as usize;
                view.slice(start..start + size_of_val(&*words)).copy_from_slice(bytemuck::cast_slice(&words));
            }
            drop(view);
            buffer.unmap();
            if !lies_open {
                let mut encoder = gpu.encoder();
                for (at, run) in placed(runs) {
                    let (into, bytes) = (run.start * WORD, (run.end - run.start) * WORD);
                    encoder.copy_buffer_to_buffer(buffer, at * WORD, &self.raw, into, bytes);
                }
                gpu.submit(encoder);
                gpu.wait()?;
            }
            gpu.check()?;
        }
        Ok(())
    }
}

/// Words as they lie in `bytes`, which need not be aligned.
fn words(bytes: &[u8]) -> Cow<'_, [u32]> {
    bytemuck::try_cast_slice(bytes).map_or_else(|_| bytemuck::pod_collect_to_vec(bytes).into(), Cow::Borrowed)
}

/// Bytes of these runs.
fn copied_bytes(runs: &[Range<u64>]) -> u64 {
    runs.iter().map(|run| (run.end - run.start) * WORD).sum()
}

/// The runs, each with the number of words before it in a copy that holds them one after the other.
fn placed(runs: &[Range<u64>]) -> impl Iterator<Item = (u64, Range<u64>)> {
    runs.iter().scan(0, |at, run| {
        let place = *at;
        *at += run.end - run.start;
        Some((place, run.clone()))
    })
}

/// The runs in groups that a staging buffer holds, or all at once if none is needed.
fn batches(runs: &[Range<u64>], at_once: bool) -> impl Iterator<Item = &[Range<u64>]> {
    let mut rest = runs;
    std::iter::from_fn(move || {
        let mut bytes = 0;
        let fits = |run: &&Range<u64>| {
            bytes += (run.end - run.start) * WORD;
            at_once || bytes <= PIECE
        };
        let count = rest.iter().take_while(fits).count().max(1).min(rest.len());
        let (batch, after) = rest.split_at(count);
        rest = after;
        (!batch.is_empty()).then_some(batch)
    })
}

fn staged(gpu: &Gpu, bytes: u64, usage: wgpu::BufferUsages, mapped: bool) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("runs of a buffer"),
        size: bytes.next_multiple_of(wgpu::MAP_ALIGNMENT),
        usage,
        mapped_at_creation: mapped,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_hold_all_runs_once() {
        let most = PIECE / WORD;
        let runs =
            [0..most / 2, most..most + most / 2, 2 * most..2 * most + 1, 4 * most..6 * most, 7 * most..7 * most + 5];
        let of = |at_once| batches(&runs, at_once).map(<[_]>::len).collect::<Vec<_>>();
        assert_eq!((of(true), of(false)), (vec![5], vec![2, 1, 1, 1]));
        assert_eq!(batches(&[], false).count(), 0);
        // Pieces are whole records.
        let pieces = cut([6..6 + 3 * (most - most % 6), 4 * most..4 * most + 6], 6);
        let whole = pieces.iter().all(|piece| piece.end - piece.start <= most && (piece.end - piece.start) % 6 == 0);
        let starts: Vec<u64> = pieces.iter().map(|piece| piece.start).collect();
        assert!(whole && starts[1..3] == [pieces[0].end, pieces[1].end], "{pieces:?}");
        let placed: Vec<_> = placed(&runs[..3]).map(|(at, _)| at).collect();
        assert_eq!(placed, [0, most / 2, most]);
    }
}
