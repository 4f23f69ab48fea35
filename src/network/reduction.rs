//! The reduction of the values of pixels over a network: the nearest depth and the sums of each
//! pixel get to the process that owns it, which resolves it, and the picture gets to process 0.
//!
//! ```text
//! nearest    to the owners, which answer   2 x 4 bytes for each covered pixel
//! sums       to the owners                 the bytes of the sums
//! fragments  to the owners                 4 bytes each and those of its record, in place of sums
//! picture    to process 0                  16 bytes a pixel, and 4 for each value of a map
//! ```
//!
//! A process sends only the samples that its own surfels cover ([`packed`](super::packed)), so the
//! bytes do not grow with the image where it is empty.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::blocks::{Blocks, marked, mask};
use super::listed::{self, Listed};
use super::packed::{Number, Packed};
use super::pixels;
use super::{Network, exchanged, gathered};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::plan::steps::{Exchanged, Reduced};
use crate::render::exchange::{Exchange, Lists, Numbers, Rows, Runs, Then, push};
use crate::scene::Samples;

/// The bytes that a process sent to others for one picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Wire {
    /// Bytes of nearest depths, and of answers about them.
    pub nearest_bytes: u64,
    /// Bytes of all sums, and of colours of nearest fragments.
    pub sums_bytes: u64,
    /// Bytes of fragments and of their numbers, where surfaces show through each other.
    pub fragments_bytes: u64,
    /// Bytes of the finished picture.
    pub picture_bytes: u64,
    /// Milliseconds in exchanges: packing, sending and waiting for other processes.
    pub exchange_ms: f64,
}

impl Wire {
    /// The bytes of such numbers.
    fn bytes_of(&mut self, what: Reduced) -> &mut u64 {
        match what {
            Reduced::Nearest => &mut self.nearest_bytes,
            Reduced::Counts => &mut self.fragments_bytes,
            Reduced::Winners | Reduced::Common(_) | Reduced::Sums => &mut self.sums_bytes,
        }
    }
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
    /// The bits of the samples whose nearest depths were sent to each owner, for common sums of the
    /// same rows.
    asked: Vec<Vec<(u32, u64)>>,
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
    fn sent(&self, to: Vec<Vec<u8>>, count: impl FnOnce(&mut Wire) -> &mut u64) -> Result<Vec<Vec<u8>>> {
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

    /// The samples of the `used` blocks with values, packed for each owner; nothing for this
    /// process.
    fn packed<T: Number>(&self, rows: &Rows, used: &[bool], (all, channels): (&[T], usize)) -> Vec<Packed> {
        let blocks = self.blocks(rows);
        let mut owned = vec![Vec::new(); self.network.size()];
        for (block, owner) in blocks.of(rows) {
            if used[block as usize] && owner != self.network.rank() {
                owned[owner].push(block);
            }
        }
        owned.par_iter().map(|own| Packed::of(blocks, own, all, channels)).collect()
    }

    /// Reduces what others sent for the pixels of this process, and notes which have values, and
    /// which blocks are `used` now.
    fn reduced<T: Number>(
        &self,
        rows: &Rows,
        (received, used): (&[Packed], &mut [bool]),
        (all, channels): (&mut [T], usize),
        reduce: fn(T, T) -> T,
    ) -> Result<()> {
        let blocks = self.blocks(rows);
        for packed in received {
            for (block, _) in packed.blocks() {
                *used.get_mut(*block as usize).ok_or_else(|| Error::Usage("a process sent damaged blocks".into()))? =
                    true;
            }
            packed.reduce(blocks, (&mut *all, channels), reduce).map_err(|what| Error::Usage(what.into()))?;
        }
        let (width, samples) = (rows.width as usize, self.samples(rows));
        let [across, down] = [samples.across, samples.down].map(|of| of.max(1) as usize);
        let mut state = self.state();
        let own = blocks.of(rows).filter(|(block, owner)| used[*block as usize] && *owner == self.network.rank());
        for (block, _) in own {
            let own = blocks.samples(block);
            let has = |sample: usize| {
                all[sample * channels..(sample + 1) * channels].iter().any(|number| *number != T::default())
            };
            let mask = mask(own.clone(), has);
            let row = (rows.first as usize + own.start / width) / down;
            // A block begins with a pixel.
            let first = row * self.width + own.start % width / across;
            let end = first + own.len().div_ceil(across);
            if state.covered.len() * 64 < end {
                state.covered.resize(end.div_ceil(64), 0);
            }
            for bit in marked(0..own.len(), mask) {
                let pixel = first + if across == 1 { bit } else { bit / across };
                state.covered[pixel / 64] |= 1 << (pixel % 64);
            }
        }
        Ok(())
    }

    /// Reduces numbers by `combine`, and answers with the results where all processes need them.
    fn exchanged<T: Number>(
        &self,
        what: Reduced,
        rows: &Rows,
        (all, combine): (&mut [T], Combine<T>),
        runs: &mut Runs,
    ) -> Result<Then> {
        let channels = all.len() / rows.samples().len().max(1);
        if channels == 0 {
            return Ok(Then::Go);
        }
        let blocks = self.blocks(rows);
        let mut used = blocks.used(rows, runs);
        let asked = match what {
            // Sums may round to zeros where a process has fragments, which need the results.
            Reduced::Common(_) => {
                let asked = std::mem::take(&mut self.state().asked);
                asked.into_iter().map(|asked| Packed::of_samples(blocks, asked, all, channels)).collect()
            }
            _ => self.packed(rows, &used, (&*all, channels)),
        };
        if what == Reduced::Nearest {
            self.state().asked = asked.iter().map(|asked| asked.blocks().to_vec()).collect();
        }
        let received = self.sent(asked.iter().map(Packed::bytes).collect(), |wire| wire.bytes_of(what))?;
        let received = read(&received)?;
        self.reduced(rows, (&received, &mut used), (&mut *all, channels), combine)?;
        match what {
            Reduced::Nearest | Reduced::Common(_) => {
                let answer = |packed: &Packed| {
                    let mut answer = Vec::with_capacity(packed.samples() * channels);
                    let places = packed.places(blocks);
                    places.for_each(|sample| answer.extend_from_slice(&all[sample * channels..][..channels]));
                    bytemuck::cast_slice(&answer).to_vec()
                };
                let answers = self.sent(received.iter().map(answer).collect(), |wire| wire.bytes_of(what))?;
                for (asked, answer) in asked.iter().zip(&answers) {
                    let answer = bytemuck::pod_collect_to_vec::<u8, T>(answer);
                    if answer.len() != asked.samples() * channels {
                        return Err(Error::Usage("a process sent a damaged answer".into()));
                    }
                    for (sample, numbers) in asked.places(blocks).zip(answer.chunks_exact(channels)) {
                        all[sample * channels..][..channels].copy_from_slice(numbers);
                    }
                }
            }
            Reduced::Winners | Reduced::Sums => {
                let others = |(block, owner): &(u32, usize)| used[*block as usize] && *owner != self.network.rank();
                for (block, _) in blocks.of(rows).filter(others) {
                    let samples = blocks.samples(block);
                    all[samples.start * channels..samples.end * channels].fill(T::default());
                }
            }
            // A process gives out places for its own fragments.
            Reduced::Counts => {}
        }
        *runs = blocks.runs(&used);
        Ok(Then::Go)
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

/// How two numbers reduce to one.
type Combine<T> = fn(T, T) -> T;

/// How two numbers of 32 bits reduce to one.
fn short_of(what: Reduced) -> Combine<u32> {
    match what {
        Reduced::Nearest | Reduced::Winners => u32::max,
        // Numbers of fragments saturate (`wgsl/lists/fragments.wgsl`).
        Reduced::Counts => u32::saturating_add,
        Reduced::Common(_) | Reduced::Sums => u32::wrapping_add,
    }
}

/// How two numbers of 64 bits reduce to one.
fn long_of(what: Reduced) -> Combine<u64> {
    match what {
        Reduced::Nearest | Reduced::Winners => u64::max,
        Reduced::Counts | Reduced::Common(_) | Reduced::Sums => u64::wrapping_add,
    }
}

/// Reads what each process sent.
fn read(received: &[Vec<u8>]) -> Result<Vec<Packed>> {
    received.iter().map(|bytes| Packed::read(bytes)).collect::<Result<_, _>>().map_err(|what| Error::Usage(what.into()))
}

impl Exchange for Reduction<'_> {
    fn agree(&self, rows: &Rows, what: Option<Exchanged>, complete: bool) -> Result<bool> {
        let next = match what {
            None => 0,
            Some(Exchanged::Triangles) => 1,
            Some(Exchanged::Fragments) => 2,
            Some(Exchanged::Numbers(Reduced::Nearest)) => 3,
            Some(Exchanged::Numbers(Reduced::Winners)) => 4,
            Some(Exchanged::Numbers(Reduced::Counts)) => 5,
            Some(Exchanged::Numbers(Reduced::Common(_))) => 6,
            Some(Exchanged::Numbers(Reduced::Sums)) => 7,
        };
        let words = [rows.render as u32, rows.first, rows.rows, rows.width, next, u32::from(complete)];
        let all = self.timed(|| gathered(self.network, bytemuck::cast_slice(&words)))?;
        let of = |bytes: &Vec<u8>| bytemuck::pod_collect_to_vec::<u8, u32>(bytes);
        let others: Vec<Vec<u32>> = all.iter().map(of).collect();
        match others.iter().all(|other| other.len() == words.len() && other[..5] == words[..5]) {
            true => Ok(others.iter().all(|other| other[5] == 1)),
            false => Err(Error::Usage(
                "the processes draw different rows at once: give all of them the same inputs, options and kind of adapter"
                    .into(),
            )),
        }
    }

    fn reduce(&self, what: Reduced, rows: &Rows, numbers: Numbers<'_>, runs: &mut Runs) -> Result<Then> {
        self.timed(|| match numbers {
            Numbers::Short(all) => self.exchanged(what, rows, (all, short_of(what)), runs),
            Numbers::Long(all) => self.exchanged(what, rows, (all, long_of(what)), runs),
        })
    }

    fn greatest(&self, own: &mut [u64]) -> Result<()> {
        let all = self.timed(|| gathered(self.network, bytemuck::cast_slice(own)))?;
        for bytes in all {
            let others = bytemuck::pod_collect_to_vec::<u8, u64>(&bytes);
            own.iter_mut().zip(others).for_each(|(own, other)| *own = other.max(*own));
        }
        Ok(())
    }

    fn fragments(&self, rows: &Rows, lists: &mut Lists) -> Result<()> {
        self.timed(|| {
            let blocks = self.blocks(rows);
            let mut to = vec![Listed::default(); self.network.size()];
            for (block, owner) in blocks.of(rows).filter(|(_, owner)| *owner != self.network.rank()) {
                for sample in blocks.samples(block) {
                    to[owner].add(lists, sample);
                    lists.clear(sample);
                }
            }
            let received = self.sent(to.iter().map(Listed::bytes).collect(), |wire| &mut wire.fragments_bytes)?;
            for bytes in received {
                listed::put(&bytes, lists).ok_or_else(|| Error::Usage("a process sent damaged fragments".into()))?;
            }
            Ok(())
        })
    }

    fn shows_all(&self) -> bool {
        // A pixel that one render covers and another does not has the background of the latter.
        self.network.rank() == 0 || self.samples.len() > 1
    }

    fn shown(&self, pixels: Range<usize>) -> Runs {
        let mut runs = Runs::new();
        let state = self.state();
        let (first, end) = (pixels.start / 64, pixels.end.div_ceil(64).min(state.covered.len()));
        for word in (first..end).filter(|word| state.covered[*word] != 0) {
            let own = (word * 64).max(pixels.start)..(word * 64 + 64).min(pixels.end);
            push(&mut runs, own.start - pixels.start..own.end - pixels.start);
        }
        runs
    }
}
