//! The exchange of the fragments of each pixel's list, where surfaces show through each other.
//!
//! The counts of fragments have been added up in the process that composites a pixel, so its list
//! has free places, which the fragments of other processes take. They lie before the fragments of
//! the process itself (`list_of` in `wgsl/lists/fragments.wgsl`). All other lists are emptied.

use std::ops::Range;

use super::numbers::of_words;
use super::{Exchange, Rows, Run, Runs, places, push};
use crate::error::Result;
use crate::gpu::runs::cut;
use crate::passes::fragments::pixel_starts;
use crate::plan::{FragmentLayout, KEY_WORDS};

/// Places between those that are written which are written too: few long runs cost less than many
/// short ones.
const GAP: usize = 256;

/// The lists of the fragments of each sample of some rows.
pub struct Lists {
    /// The first place of each sample's list, and the end of the last list.
    starts: Vec<u32>,
    /// The number of free places of each sample's list, which come first.
    free: Vec<u32>,
    /// The depth of the fragment at each place, as bits, and the place ([`KEY_WORDS`]).
    keys: Vec<u32>,
    /// The record of the fragment at each place ([`FragmentLayout`]).
    records: Vec<u32>,
    /// Words of a record.
    words: usize,
    /// The places that fragments of other processes took.
    taken: Vec<Range<u32>>,
}

/// The words of a fragment that is sent: its depth and its record.
pub type Sent<'a> = (u32, &'a [u32]);

impl Lists {
    /// Words of a fragment's record.
    pub fn words(&self) -> usize {
        self.words
    }

    /// The places of a sample's fragments.
    pub fn places(&self, sample: usize) -> Range<usize> {
        let (start, end) = (self.starts[sample], self.starts[sample + 1]);
        // Beyond the length of the list the number has wrapped, and no place is free.
        let free = if self.free[sample] > end - start { 0 } else { self.free[sample] };
        (start + free) as usize..end as usize
    }

    /// The fragment at a place.
    pub fn at(&self, place: usize) -> Sent<'_> {
        (self.keys[place * KEY_WORDS as usize], &self.records[place * self.words..(place + 1) * self.words])
    }

    /// Adds a fragment of another process to the list of a sample. As on the device, a fragment
    /// without a free place is left out. None if there is no such sample, or if records have other
    /// words.
    pub fn add(&mut self, sample: usize, (depth, record): Sent<'_>) -> Option<()> {
        let start = *self.starts.get(sample).filter(|_| sample + 1 < self.starts.len())?;
        if record.len() != self.words {
            return None;
        }
        let place = self.places(sample).start as u32;
        if place == start {
            return Some(());
        }
        let place = place - 1;
        self.keys[place as usize * KEY_WORDS as usize..][..2].copy_from_slice(&[depth, place]);
        self.records[place as usize * self.words..][..self.words].copy_from_slice(record);
        self.free[sample] -= 1;
        match self.taken.last_mut() {
            Some(last) if last.start == place + 1 => last.start = place,
            _ => self.taken.push(place..place + 1),
        }
        Some(())
    }

    /// Empties the list of a sample.
    pub fn clear(&mut self, sample: usize) {
        self.free[sample] = self.starts[sample + 1] - self.starts[sample];
    }

    /// The places that fragments of other processes took, ascending, with few others between them.
    fn runs(&mut self) -> Runs {
        self.taken.sort_by_key(|taken| taken.start);
        let mut runs = Runs::new();
        for taken in &self.taken {
            let (start, end) = (taken.start as usize, taken.end as usize);
            let last = runs.last().map_or(start, |last| last.end);
            push(&mut runs, if start - last <= GAP { last..end } else { start..end });
        }
        runs
    }
}

impl Run<'_> {
    /// Exchanges the fragments of all lists, before they are sorted.
    pub(super) fn exchange_fragments(&mut self, exchange: &dyn Exchange, rows: &Rows) -> Result<()> {
        let gpu = self.gpu;
        let buffer = |name: &str| self.store.buffer(name).ok_or_else(|| gpu.error("a frame has no lists of fragments"));
        let [of_starts, of_free, of_keys, of_records] = ["starts", "nearest", "keys", "fragments"].map(buffer);
        let (of_starts, of_free, of_keys, of_records) = (of_starts?, of_free?, of_keys?, of_records?);
        let samples = rows.samples().len() as u64;
        let starts = self.read_words(of_starts, pixel_starts(rows.rows, samples))?;
        let total = u64::from(starts.last().copied().unwrap_or(0));
        let words = FragmentLayout::of(&self.plan.needs).words;
        let mut lists = Lists {
            free: self.read_words(of_free, 0..samples)?,
            keys: self.read_words(of_keys, 0..total * KEY_WORDS)?,
            records: self.read_words(of_records, 0..total * u64::from(words))?,
            words: words as usize,
            taken: Vec::new(),
            starts,
        };
        exchange.fragments(rows, &mut lists)?;
        let runs = lists.runs();
        let keys = &lists.keys;
        of_keys.write_runs(gpu, &of_words(&runs, KEY_WORDS), |run| keys[places(&run)].into())?;
        let records = &lists.records;
        of_records.write_runs(gpu, &of_words(&runs, words.into()), |run| records[places(&run)].into())?;
        let all = std::iter::once(0..samples);
        of_free.write_runs(gpu, &cut(all, 1), |run| lists.free[places(&run)].into())
    }
}
