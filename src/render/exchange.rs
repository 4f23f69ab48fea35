//! The places at which processes that draw a frame together exchange values of its pixels.
//!
//! Two stages of a frame reduce: visibility takes a minimum of depths, and accumulate adds
//! integers. Both are associative and commutative, so each process may draw a share of the surfels
//! ([`share`](crate::passes::share)) and the processes reduce their results in any order: the frame
//! has the bits of one process. An [`Exchange`] does that over files, threads or a network. It is
//! called for each band of a render, and at the end of a frame once more to agree:
//!
//! ```text
//! agree       all processes have complete values, or all of them try again
//! triangles   a process draws all of them, gets those of another, or needs none
//! nearest     nearest(x, y) = min over processes, before accumulate compares depths with it
//! sums        sums(x, y)    = sum over processes, before resolve divides
//! ```
//!
//! A frame without an exchange is the same steps without these calls. An exchange only ever gets
//! values of complete bands: a try whose buffers were too small is repeated before it is called.

use std::ops::Range;

use super::count::Capacities;
use super::run::Run;
use crate::error::Result;
use crate::passes::accumulate;
use crate::plan::Plan;
use crate::plan::extra::TRIANGLE_PIXEL_WORDS;
use crate::plan::steps::Exchanged;

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
    /// values of a try that others repeat. A frame ends with a call for no rows.
    ///
    /// # Errors
    /// Any error of the exchange.
    fn agree(&self, _rows: &Rows, complete: bool) -> Result<bool> {
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

    /// Replaces the nearest depths of `rows`, one word for each sample, by those of all processes.
    /// A depth is stored as bits(+inf) - bits(depth), so the nearest is the greatest word, and 0 is
    /// nothing. `runs` are the samples that may have other values than 0, before and after.
    ///
    /// # Errors
    /// Any error of the exchange.
    fn nearest(&self, rows: &Rows, words: &mut [u32], runs: &mut Runs) -> Result<Then>;

    /// Replaces the sums of `rows`, [`PixelLayout::channels`](crate::plan::PixelLayout::channels)
    /// for each sample, by those of all processes, added. `runs` are the samples that may have
    /// other values than 0, before and after; runs of zeros that it had before are kept.
    ///
    /// # Errors
    /// Any error of the exchange.
    fn sums(&self, rows: &Rows, sums: &mut [u64], runs: &mut Runs) -> Result<Then>;

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

/// Samples by which runs begin and end, so that few runs hold a sparse image.
const GRAIN: usize = 64;

/// The runs of [`GRAIN`] samples in which a word is not 0.
fn covered(words: &[u32]) -> Runs {
    let mut runs = Runs::new();
    for (number, words) in words.chunks(GRAIN).enumerate() {
        if words.iter().fold(0, |bits, word| bits | word) != 0 {
            let first = number * GRAIN;
            push(&mut runs, first..first + words.len());
        }
    }
    runs
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
        let then = match what {
            Exchanged::Triangles => {
                let drawn = || self.drawn_triangles(band);
                if let Some(given) = exchange.triangles(&rows, &drawn)? {
                    self.put_triangles(band, &given)?;
                }
                Then::Go
            }
            Exchanged::Nearest => {
                if !exchange.agree(&rows, self.is_complete(band)?)? {
                    return Ok(Onward::Retry);
                }
                self.exchange_nearest(exchange, &rows)?
            }
            Exchanged::Sums => {
                if !exchange.agree(&rows, self.is_complete(band)?)? {
                    return Ok(Onward::Retry);
                }
                self.exchange_sums(exchange, &rows)?
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

    /// Exchanges nearest depths, and notes where this process has some.
    fn exchange_nearest(&mut self, exchange: &dyn Exchange, rows: &Rows) -> Result<Then> {
        let samples = rows.samples().len();
        self.covered = std::iter::once(0..samples).collect();
        let mut words = vec![0; samples];
        let Some(buffer) = self.store.buffer("nearest") else { return Ok(Then::Go) };
        let all = 0..samples as u64;
        buffer.visit_runs(self.gpu, std::slice::from_ref(&all), |_, own| words.copy_from_slice(own))?;
        self.covered = covered(&words);
        let mut runs = self.covered.clone();
        let then = exchange.nearest(rows, &mut words, &mut runs)?;
        if then == Then::Go {
            buffer.write_runs(self.gpu, &of_words(&runs, 1), |run| words[places(&run)].into())?;
        }
        Ok(then)
    }

    /// Exchanges sums. Only the samples in which this process has a nearest depth have any.
    fn exchange_sums(&self, exchange: &dyn Exchange, rows: &Rows) -> Result<Then> {
        let Self { gpu, plan, .. } = *self;
        let (Some(buffer), words) = (self.store.buffer("sums"), u64::from(plan.sum_words)) else {
            return exchange.sums(rows, &mut [], &mut Runs::new());
        };
        let channels = words as usize / 2;
        // Memory of zeros is taken where it is written.
        let mut sums = vec![0u64; rows.samples().len() * channels];
        let mut runs = self.covered.clone();
        let of_run = |run: &Range<u64>| places(&(run.start / words..run.end / words));
        let of_sums = |samples: Range<usize>| samples.start * channels..samples.end * channels;
        buffer.visit_runs(gpu, &of_words(&runs, words), |run, stored| {
            accumulate::canonical(&plan.needs, stored, &mut sums[of_sums(of_run(&run))]);
        })?;
        let then = exchange.sums(rows, &mut sums, &mut runs)?;
        if then == Then::Go {
            buffer.write_runs(gpu, &of_words(&runs, words), |run| {
                accumulate::kept(&plan.needs, &sums[of_sums(of_run(&run))])
            })?;
        }
        Ok(then)
    }

    /// The first words of a buffer; none if the frame does not have it.
    fn words(&self, name: &str, len: u64) -> Result<Vec<u32>> {
        self.store.buffer(name).map_or_else(|| Ok(Vec::new()), |buffer| buffer.read(self.gpu, len))
    }

    /// Overwrites the first `len` words of a buffer.
    fn put(&self, name: &str, words: &[u32], len: u64) -> Result<()> {
        let Some(buffer) = self.store.buffer(name) else { return Ok(()) };
        if words.len() as u64 != len {
            return Err(self.gpu.error("values of pixels were exchanged that belong to another frame"));
        }
        buffer.write(self.gpu, words.len(), |range| words[range].into(), &())
    }

    /// The shaded triangles of each pixel of `band`, with 0 in tiles where none shows.
    fn drawn_triangles(&self, band: usize) -> Result<Vec<u32>> {
        let of = &self.plan.bands[band];
        let pixels = of.pixels as usize * TRIANGLE_PIXEL_WORDS as usize;
        let mut words = self.words("triangle_pixels", triangle_words(self.plan, band))?;
        let tiles = words.split_off(pixels.min(words.len()));
        let width = self.plan.width as usize;
        for (pixel, record) in words.chunks_exact_mut(TRIANGLE_PIXEL_WORDS as usize).enumerate() {
            let tile = tile_of(pixel, width);
            // Pixels of tiles without triangles hold values of earlier bands.
            if tiles.get(4 * tile).is_none_or(|shows| *shows == 0) {
                record.fill(0);
            }
        }
        Ok(words)
    }

    /// Writes the shaded triangles of `band`, and which tiles have any.
    fn put_triangles(&self, band: usize, given: &[u32]) -> Result<()> {
        let of = &self.plan.bands[band];
        let mut words = given.to_vec();
        words.resize(triangle_words(self.plan, band) as usize, 0);
        let pixels = of.pixels as usize * TRIANGLE_PIXEL_WORDS as usize;
        if given.len() != pixels {
            return Err(self.gpu.error("triangles of pixels were exchanged that belong to another frame"));
        }
        for (pixel, record) in given.chunks_exact(TRIANGLE_PIXEL_WORDS as usize).enumerate() {
            if record.iter().any(|word| *word != 0) {
                let tile = pixels + 4 * tile_of(pixel, self.plan.width as usize);
                words[tile..tile + 4].fill(1f32.to_bits());
            }
        }
        self.put("triangle_pixels", &words, words.len() as u64)
    }
}

/// The words of runs of samples, `each` for each sample.
fn of_words(runs: &Runs, each: u64) -> Vec<Range<u64>> {
    runs.iter().map(|run| run.start as u64 * each..run.end as u64 * each).collect()
}

/// A range as places in memory.
fn places(range: &Range<u64>) -> Range<usize> {
    range.start as usize..range.end as usize
}

/// The side of the tiles that know whether triangles show in them, pixels
/// (`wgsl/triangles/triangles_tiles.wgsl`).
const TILE: usize = crate::gpu::layout::OCCLUSION_TILE as usize;

/// The tile of a band's pixel.
fn tile_of(pixel: usize, width: usize) -> usize {
    pixel / width / TILE * width.div_ceil(TILE) + pixel % width / TILE
}

/// Words of a band's shaded triangles, its tiles included.
fn triangle_words(plan: &Plan, band: usize) -> u64 {
    crate::passes::triangles::pixel_words(&plan.bands[band])
}

/// The triangle stages of a process that is given the triangles are left out.
pub(super) fn is_of_triangles(pass: &str) -> bool {
    pass == crate::passes::triangles::PASS.name
}
