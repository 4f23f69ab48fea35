//! The reduction of the values of pixels over a network: the nearest depth and the sums of each
//! pixel get to the process that owns it, which resolves it, and the picture gets to process 0.
//!
//! ```text
//! nearest  to the owners, which answer     2 x 4 bytes for each covered pixel
//! sums     to the owners                   the bytes of the sums
//! picture  to process 0                    16 bytes a pixel, and 4 for each value of a map
//! ```
//!
//! A process sends only the samples that its own surfels cover ([`packed`](super::packed)), so the
//! bytes do not grow with the image where it is empty.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::blocks::Blocks;
use super::packed::Packed;
use super::{Network, exchanged, gathered};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::render::exchange::{Exchange, Rows, Then};
use crate::scene::Samples;

/// The bytes that a process sent to others for one picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wire {
    /// Bytes of nearest depths, and of answers about them.
    pub nearest_bytes: u64,
    /// Bytes of sums.
    pub sums_bytes: u64,
    /// Bytes of the finished picture.
    pub picture_bytes: u64,
    /// Milliseconds in exchanges: packing, sending and waiting for other processes.
    pub exchange_ms: f64,
}

/// Reduces the values of one picture's pixels.
pub struct Reduction<'a> {
    network: &'a dyn Network,
    /// Samples of a pixel in each render of the picture.
    samples: Vec<Samples>,
    /// Columns of the picture, pixels.
    width: usize,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    /// The pixels of this process that have values, as bits.
    covered: Vec<u64>,
    wire: Wire,
}

impl<'a> Reduction<'a> {
    /// The reduction of a picture of `width` pixels in a row, whose renders have these `samples` in
    /// each.
    pub fn new(network: &'a dyn Network, width: u32, samples: Vec<Samples>) -> Self {
        Self { network, samples, width: width as usize, state: Mutex::default() }
    }

    /// The bytes that this process sent so far.
    pub fn wire(&self) -> Wire {
        self.state().wire
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn samples(&self, rows: &Rows) -> Samples {
        self.samples.get(rows.render).copied().unwrap_or_default()
    }

    fn blocks(&self, rows: &Rows) -> Blocks {
        Blocks::new(rows.width, self.samples(rows), Blocks::pixels(&self.samples), self.network.size())
    }

    /// Sends bytes, and counts those for other processes by `count`.
    fn sent(&self, to: Vec<Vec<u8>>, count: fn(&mut Wire) -> &mut u64) -> Result<Vec<Vec<u8>>> {
        let others = to.iter().enumerate().filter(|(to, _)| *to != self.network.rank());
        *count(&mut self.state().wire) += others.map(|(_, bytes)| bytes.len() as u64).sum::<u64>();
        exchanged(self.network, Ok(to))
    }

    /// Runs an exchange and counts its time.
    fn timed<T>(&self, exchange: impl FnOnce() -> Result<T>) -> Result<T> {
        let start = Instant::now();
        let outcome = exchange();
        self.state().wire.exchange_ms += start.elapsed().as_secs_f64() * 1e3;
        outcome
    }

    /// The samples of `rows` with values, packed for each owner; nothing for this process.
    fn packed(&self, rows: &Rows, all: &[u64], channels: usize) -> Vec<Packed> {
        let blocks = self.blocks(rows);
        let mut owned = vec![Vec::new(); self.network.size()];
        for (block, owner) in blocks.of(rows) {
            if owner != self.network.rank() {
                owned[owner].push(block);
            }
        }
        owned.par_iter().map(|own| Packed::of(blocks, own, all, channels)).collect()
    }

    /// Reduces what others sent for the pixels of this process, and notes which have values.
    fn reduced(
        &self,
        rows: &Rows,
        received: &[Packed],
        (all, channels): (&mut [u64], usize),
        reduce: fn(u64, u64) -> u64,
    ) -> Result<()> {
        let blocks = self.blocks(rows);
        for packed in received {
            packed.reduce(blocks, (&mut *all, channels), reduce).map_err(|what| Error::Usage(what.into()))?;
        }
        let (width, samples) = (rows.width as usize, self.samples(rows));
        let mut state = self.state();
        let own = blocks.of(rows).filter(|(_, owner)| *owner == self.network.rank());
        let own = own.map(|(block, _)| blocks.samples(block));
        let any = |samples: &Range<usize>| {
            all[samples.start * channels..samples.end * channels].iter().any(|number| *number != 0)
        };
        for sample in own.filter(any).flatten() {
            if any(&(sample..sample + 1)) {
                let row = (rows.first as usize + sample / width) / samples.down as usize;
                let pixel = row * self.width + sample % width / samples.across as usize;
                let word = pixel / 64;
                if state.covered.len() <= word {
                    state.covered.resize(word + 1, 0);
                }
                state.covered[word] |= 1 << (pixel % 64);
            }
        }
        Ok(())
    }

    /// Brings the pixels of all processes together. Returns the picture in process 0, and none in
    /// the others.
    ///
    /// # Errors
    /// Any error of the network.
    pub fn gathered(&self, frame: Frame) -> Result<Option<Frame>> {
        self.timed(|| {
            let rank = self.network.rank();
            let own = if rank == 0 { Vec::new() } else { pixels::bytes(&frame, &self.state().covered) };
            let mut to = vec![Vec::new(); self.network.size()];
            to[0] = own;
            let received = self.sent(to, |wire| &mut wire.picture_bytes)?;
            if rank > 0 {
                return Ok(None);
            }
            let mut frame = frame;
            for bytes in received.iter().skip(1) {
                pixels::put(&mut frame, bytes).ok_or_else(|| Error::Usage("a process sent damaged pixels".into()))?;
            }
            Ok(Some(frame))
        })
    }
}

/// Reads what each process sent.
fn read(received: &[Vec<u8>]) -> Result<Vec<Packed>> {
    received.iter().map(|bytes| Packed::read(bytes)).collect::<Result<_, _>>().map_err(|what| Error::Usage(what.into()))
}

impl Exchange for Reduction<'_> {
    fn agree(&self, rows: &Rows, complete: bool) -> Result<bool> {
        let words = [rows.render as u32, rows.first, rows.rows, rows.width, u32::from(complete)];
        let all = self.timed(|| gathered(self.network, bytemuck::cast_slice(&words)))?;
        let of = |bytes: &Vec<u8>| bytemuck::pod_collect_to_vec::<u8, u32>(bytes);
        let others: Vec<Vec<u32>> = all.iter().map(of).collect();
        match others.iter().all(|other| other.len() == words.len() && other[..4] == words[..4]) {
            true => Ok(others.iter().all(|other| other[4] == 1)),
            false => Err(Error::Usage(
                "the processes draw different rows at once: give all of them the same inputs, options and kind of adapter"
                    .into(),
            )),
        }
    }

    fn nearest(&self, rows: &Rows, words: &mut Vec<u32>) -> Result<Then> {
        self.timed(|| {
            let blocks = self.blocks(rows);
            let mut all: Vec<u64> = words.iter().map(|word| u64::from(*word)).collect();
            let asked = self.packed(rows, &all, 1);
            let received = self.sent(asked.iter().map(Packed::bytes).collect(), |wire| &mut wire.nearest_bytes)?;
            let received = read(&received)?;
            self.reduced(rows, &received, (&mut all, 1), u64::max)?;
            let answer = |packed: &Packed| {
                packed.places(blocks).flat_map(|sample| (all[sample] as u32).to_le_bytes()).collect::<Vec<u8>>()
            };
            let answers = self.sent(received.iter().map(answer).collect(), |wire| &mut wire.nearest_bytes)?;
            for (asked, answer) in asked.iter().zip(&answers) {
                for (sample, word) in asked.places(blocks).zip(bytemuck::pod_collect_to_vec::<u8, u32>(answer)) {
                    all[sample] = word.into();
                }
            }
            words.iter_mut().zip(all).for_each(|(word, reduced)| *word = reduced as u32);
            Ok(Then::Go)
        })
    }

    fn sums(&self, rows: &Rows, sums: &mut Vec<u64>) -> Result<Then> {
        self.timed(|| {
            let channels = sums.len() / rows.samples().len().max(1);
            if channels == 0 {
                return Ok(Then::Go);
            }
            let packed = self.packed(rows, sums, channels);
            let received = self.sent(packed.iter().map(Packed::bytes).collect(), |wire| &mut wire.sums_bytes)?;
            self.reduced(rows, &read(&received)?, (sums, channels), u64::wrapping_add)?;
            let blocks = self.blocks(rows);
            for (block, _) in blocks.of(rows).filter(|(_, owner)| *owner != self.network.rank()) {
                let samples = blocks.samples(block);
                sums[samples.start * channels..samples.end * channels].fill(0);
            }
            Ok(Then::Go)
        })
    }
}

/// Some pixels of a frame as bytes.
mod pixels {
    use super::Frame;
    use crate::scene::Map;

    /// Words of a pixel: its colour, and its values of each map.
    fn words(frame: &Frame) -> usize {
        4 + frame.maps().iter().map(Map::width).sum::<usize>()
    }

    /// The pixels of `frame` that are set in `covered`: their numbers, then their values.
    pub fn bytes(frame: &Frame, covered: &[u64]) -> Vec<u8> {
        let is_set = |pixel: &usize| covered.get(pixel / 64).is_some_and(|word| word >> (pixel % 64) & 1 == 1);
        let pixels: Vec<usize> = (0..frame.color.len()).filter(is_set).collect();
        let mut values = Vec::with_capacity(1 + pixels.len() * (1 + words(frame)));
        values.push(pixels.len() as u32);
        values.extend(pixels.iter().map(|pixel| *pixel as u32));
        values.extend(pixels.iter().flat_map(|pixel| frame.color[*pixel].map(f32::to_bits)));
        for map in frame.maps().iter() {
            let (all, width) = (frame.map(map).unwrap_or_default(), map.width());
            let of_pixel = |pixel: &usize| all[pixel * width..(pixel + 1) * width].iter().map(|value| value.to_bits());
            values.extend(pixels.iter().flat_map(of_pixel));
        }
        bytemuck::cast_slice(&values).to_vec()
    }

    /// Puts the pixels of [`bytes`] into a frame; None if they are not those of such a frame.
    pub fn put(frame: &mut Frame, bytes: &[u8]) -> Option<()> {
        let values = bytemuck::pod_collect_to_vec::<u8, u32>(bytes);
        let (count, rest) = values.split_first()?;
        let (pixels, mut rest) = rest.split_at_checked(*count as usize)?;
        if rest.len() != pixels.len() * words(frame) {
            return None;
        }
        let mut take = |width: usize| {
            let (taken, after) = rest.split_at(pixels.len() * width);
            rest = after;
            taken
        };
        for (pixel, color) in pixels.iter().zip(take(4).chunks_exact(4)) {
            *frame.color.get_mut(*pixel as usize)? = [0, 1, 2, 3].map(|k| f32::from_bits(color[k]));
        }
        for map in frame.maps().iter() {
            let width = map.width();
            let all = frame.map_mut(map)?;
            for (pixel, values) in pixels.iter().zip(take(width).chunks_exact(width)) {
                let first = *pixel as usize * width;
                let own = all.get_mut(first..first + width)?;
                own.iter_mut().zip(values).for_each(|(own, value)| *own = f32::from_bits(*value));
            }
        }
        Some(())
    }
}
