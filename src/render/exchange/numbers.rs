//! The exchange of the numbers of each pixel: depths, counts and sums.

use std::ops::Range;

use super::{Exchange, Numbers, Rows, Run, Runs, Then, places, push};
use crate::error::Result;
use crate::gpu::buffers::Buffer;
use crate::gpu::runs::cut;
use crate::passes::accumulate;
use crate::plan::extra::words_of;
use crate::plan::steps::Reduced;
use crate::plan::{Oit, Surface, Winner};

/// Samples by which runs begin and end, so that few runs hold a sparse image.
const GRAIN: usize = 64;

impl Run<'_> {
    /// Exchanges numbers of each pixel. Notes the samples in which this process has some, because
    /// later numbers of these rows are 0 in all others.
    pub(super) fn exchange_numbers(&mut self, what: Reduced, exchange: &dyn Exchange, rows: &Rows) -> Result<Then> {
        let Self { gpu, plan, .. } = *self;
        let (name, words) = match what {
            Reduced::Nearest | Reduced::Counts => ("nearest", 1),
            Reduced::Common(name) => (name, words_of(name, &plan.needs)),
            Reduced::Winners | Reduced::Sums => ("sums", plan.sum_words),
        };
        let samples = rows.samples().len();
        let all = std::iter::once(0..samples).collect();
        // Without a visibility pass nothing tells where sums are.
        let is_first = match what {
            Reduced::Nearest | Reduced::Counts => true,
            Reduced::Winners => plan.needs.surface == Surface::Nearest(Winner::Once),
            Reduced::Common(_) => false,
            Reduced::Sums => plan.needs.surface.oit() == Some(Oit::Weighted),
        };
        let mut runs: Runs = if is_first { all } else { self.covered.clone() };
        let Some(buffer) = self.store.buffer(name).filter(|_| words > 0) else { return Ok(Then::Go) };
        let each = u64::from(words);
        // Memory of zeros is taken where it is written.
        if words == 1 {
            let mut own = vec![0u32; samples];
            buffer.visit_runs(gpu, &of_words(&runs, 1), |run, stored| own[places(&run)].copy_from_slice(stored))?;
            if is_first {
                runs = covered(&own, 1);
                self.covered.clone_from(&runs);
            }
            let then = exchange.reduce(what, rows, Numbers::Short(&mut own), &mut runs)?;
            if then == Then::Go {
                buffer.write_runs(gpu, &of_words(&runs, 1), |run| own[places(&run)].into())?;
            }
            return Ok(then);
        }
        let channels = words as usize / 2;
        let needs = (what == Reduced::Sums).then_some(&plan.needs);
        let of_run = |run: &Range<u64>| {
            let samples = places(&(run.start / each..run.end / each));
            samples.start * channels..samples.end * channels
        };
        let mut own = vec![0u64; samples * channels];
        buffer.visit_runs(gpu, &of_words(&runs, each), |run, stored| {
            accumulate::canonical(needs, stored, &mut own[of_run(&run)]);
        })?;
        if is_first {
            runs = covered(&own, channels);
            self.covered.clone_from(&runs);
        }
        let then = exchange.reduce(what, rows, Numbers::Long(&mut own), &mut runs)?;
        if then == Then::Go {
            buffer.write_runs(gpu, &of_words(&runs, each), |run| accumulate::kept(needs, &own[of_run(&run)]))?;
        }
        Ok(then)
    }

    /// These words of a buffer.
    pub(super) fn read_words(&self, buffer: &Buffer<u32>, words: Range<u64>) -> Result<Vec<u32>> {
        let mut all = vec![0; places(&words).len()];
        buffer.visit_runs(self.gpu, &cut([words.clone()], 1), |run, stored| {
            all[places(&(run.start - words.start..run.end - words.start))].copy_from_slice(stored);
        })?;
        Ok(all)
    }
}

/// The runs of [`GRAIN`] samples, `each` numbers for each, in which a number is not 0.
fn covered<T: Copy + Default + PartialEq>(numbers: &[T], each: usize) -> Runs {
    let mut runs = Runs::new();
    for (place, numbers) in numbers.chunks(GRAIN * each).enumerate() {
        if numbers.iter().any(|number| *number != T::default()) {
            let first = place * GRAIN;
            push(&mut runs, first..first + numbers.len() / each);
        }
    }
    runs
}

/// The words of runs of samples, `each` for each sample.
pub(in super::super) fn of_words(runs: &Runs, each: u64) -> Vec<Range<u64>> {
    cut(runs.iter().map(|run| run.start as u64 * each..run.end as u64 * each), each)
}
