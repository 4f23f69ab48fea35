//! The places at which processes that draw a frame together exchange values of its pixels.
//!
//! The stages of a frame reduce: visibility takes a minimum of depths, and accumulate adds
//! integers. Both are associative and commutative, so each process may draw a share of the surfels
//! ([`share`](crate::passes::share)) and the processes reduce their results in any order: the frame
//! has the bits of one process. Where surfaces show through each other, lists of fragments are
//! joined before they are sorted. An [`Exchange`] does that over files, threads or a network. It is
//! called for each band of a render, and at the end of a frame once more to agree:
//!
//! ```text
//! agree       all processes have complete values, or all of them try again
//! triangles   a process draws all of them, gets those of another, or needs none
//! nearest     nearest(x, y) = min over processes, before accumulate compares depths with it
//! sums        sums(x, y)    = sum over processes, before resolve divides
//! moments     moment(x, y)  = sum over processes, before accumulate weights by them
//! winners     winner(x, y)  = max over processes, where only the nearest fragment shows
//! counts      count(x, y)   = sum over processes, before places in lists are given out
//! fragments   list(x, y)    = union over processes, before it is sorted
//! ```
//!
//! A frame without an exchange is the same steps without these calls. An exchange only ever gets
//! values of complete bands: a try whose buffers were too small is repeated before it is called.

mod lists;
pub(super) mod numbers;
mod triangles;

use std::ops::Range;

pub use self::lists::Lists;

use super::count::Capacities;
use super::run::Run;
use crate::error::Result;
use crate::plan::steps::{Exchanged, Reduced};

/// Rows of samples of one of the renders that make a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rows {
    /// Number of the render: 0 is that of the colour, others make maps.
    pub render: usize,
    /// The first row, in samples from the top.
    pub first: u32,
    /// Number of rows, samples.
    pub rows: u32,
    /// Columns of the render, samples.
    pub width: u32,
}

impl Rows {
    /// No rows of a render.
    pub fn none(render: usize) -> Self {
        Self { render, first: 0, rows: 0, width: 0 }
    }

    /// The range of these samples among those of the whole render, row by row.
    pub fn samples(&self) -> Range<usize> {
        let [first, rows, width] = [self.first, self.rows, self.width].map(|n| n as usize);
        first * width..(first + rows) * width
    }
}

/// The work of a process on a band after an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Then {
    /// Goes on with the exchanged values.
    Go,
    /// Leaves the rest of the band out, and the band has no image.
    Stop,
}

/// Reduces values of pixels over all processes that draw a frame together.
///
/// Bands follow from the adapter's limits, so processes that exchange at once need the same limits.
/// An exchange through files may have other rows in each process. A frame that is retried repeats
/// its calls.
pub trait Exchange: Sync {
    /// Whether the process draws the triangles itself. If not, [`Exchange::triangles`] gives them,
    /// unless the band ends before they are needed.
    fn draws_triangles(&self) -> bool {
        true
    }

    /// Whether all processes have values of complete buffers for `rows`, so that none exchanges
    /// values of a try that others repeat. `what` is exchanged next; a frame ends with a call for
    /// nothing and no rows.
    ///
    /// # Errors
    /// Any error of the exchange.
    fn agree(&self, _rows: &Rows, _what: Option<Exchanged>, complete: bool) -> Result<bool> {
        Ok(complete)
    }

    /// Keeps or gives the shaded triangles of `rows`, 8 words for each sample; all are 0 where no
    /// triangle shows. The function reads those that this process drew. The result takes their
    /// place, unless it is `None`.
    ///
    /// # Errors
    /// Any error of the device or of the exchange.
    fn triangles(&self, _rows: &Rows, _drawn: &dyn Fn() -> Result<Vec<u32>>) -> Result<Option<Vec<u32>>> {
        Ok(None)
    }

    /// Replaces numbers of `rows` by those that the numbers of all processes reduce to. Each sample
    /// has an equal number of them. `runs` are the samples that may have other values than 0, both
    /// before and after; runs of zeros that it had before are kept.
    ///
    /// A nearest depth is stored as bits(+inf) - bits(depth), so the nearest is the greatest, and 0
    /// is nothing. There are [`PixelLayout::channels`](crate::plan::PixelLayout::channels) sums.
    ///
    /// # Errors
    /// Any error of the exchange, and [`Error::Usage`](crate::Error::Usage) for numbers that it
    /// does not carry.
    fn reduce(&self, what: Reduced, rows: &Rows, numbers: Numbers<'_>, runs: &mut Runs) -> Result<Then>;

    /// Replaces each number by the greatest one of all processes.
    ///
    /// # Errors
    /// Any error of the exchange.
    fn greatest(&self, _own: &mut [u64]) -> Result<()> {
        Ok(())
    }

    /// Moves the fragments of each sample of `rows` to the process that composites it.
    ///
    /// # Errors
    /// Any error of the exchange, and [`Error::Usage`](crate::Error::Usage) if it carries none.
    fn fragments(&self, rows: &Rows, lists: &mut Lists) -> Result<()>;

    /// Whether the process needs all pixels as they are shown.
    fn shows_all(&self) -> bool {
        true
    }

    /// The ones among these pixels of the picture that the process needs as they are shown, counted
    /// from the first one, unless it [needs all](Self::shows_all).
    fn shown(&self, pixels: Range<usize>) -> Runs {
        std::iter::once(0..pixels.len()).collect()
    }
}

/// Runs of samples or pixels, ascending and apart.
pub type Runs = Vec<Range<usize>>;

/// Numbers of samples, as many for each.
pub enum Numbers<'a> {
    /// Numbers of 32 bits.
    Short(&'a mut [u32]),
    /// Numbers of 64 bits.
    Long(&'a mut [u64]),
}

/// Appends a run, which ascends, to the last one if they touch.
pub fn push(runs: &mut Runs, next: Range<usize>) {
    match runs.last_mut() {
        Some(last) if last.end >= next.start => last.end = last.end.max(next.end),
        _ => runs.push(next),
    }
}

/// An exchange, and the render of the frame that it is called for.
#[derive(Clone, Copy)]
pub(super) struct Among<'a> {
    pub exchange: &'a dyn Exchange,
    pub render: usize,
}

/// How a try goes on after an exchange.
pub(super) enum Onward {
    /// With the next step.
    Next,
    /// With the next band.
    EndBand,
    /// With another try, because buffers were too small.
    Retry,
}

impl Run<'_> {
    /// Exchanges values of `band`, if several processes draw the frame.
    pub(super) fn exchange(&mut self, what: Exchanged, band: usize) -> Result<Onward> {
        let Some(Among { exchange, render }) = self.among else { return Ok(Onward::Next) };
        let of = &self.plan.bands[band];
        let rows = Rows { render, first: of.first, rows: of.rows, width: self.plan.width };
        self.timing.flush(self.gpu)?;
        if what != Exchanged::Triangles && !exchange.agree(&rows, Some(what), self.is_complete(band)?)? {
            return Ok(Onward::Retry);
        }
        let then = match what {
            Exchanged::Triangles => {
                let drawn = || self.drawn_triangles(band);
                if let Some(given) = exchange.triangles(&rows, &drawn)? {
                    self.put_triangles(band, &given)?;
                }
                Then::Go
            }
            Exchanged::Numbers(what) => self.exchange_numbers(what, exchange, &rows)?,
            Exchanged::Fragments => {
                self.exchange_fragments(exchange, &rows)?;
                Then::Go
            }
        };
        Ok(if then == Then::Go { Onward::Next } else { Onward::EndBand })
    }

    /// Whether the buffers held everything so far. If not, the sizes for the next try are recorded.
    fn is_complete(&mut self, band: usize) -> Result<bool> {
        let capacities = Capacities::of(self.plan, self.store, self.by_tiles);
        let counted = self.timing.counts(self.gpu, &capacities.counters(self.store))?;
        let compared = capacities.compared(&counted);
        let complete = compared.lacking == 0;
        if !complete {
            self.count(band, &counted);
            self.learn();
        }
        Ok(complete)
    }
}

/// A range as places in memory.
fn places(range: &Range<u64>) -> Range<usize> {
    range.start as usize..range.end as usize
}

/// The triangle stages of a process that is given the triangles are left out.
pub(super) fn is_of_triangles(pass: &str) -> bool {
    pass == crate::passes::triangles::PASS.name
}
