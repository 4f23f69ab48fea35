//! Reads counts from the device in the middle of a frame, where they determine the sizes of
//! buffers.

use super::exchange::Exchange;
use super::run::Run;
use crate::error::{Error, Result};
use crate::gpu::layout::BATCH;
use crate::passes::tiles::{LONGEST, list_name};
use crate::passes::{fragments, long_lists};
use crate::plan::known::Listed;
use crate::plan::steps::{Part, Stage};
use crate::plan::{FragmentLayout, KEY_WORDS, Lists, tuning};

impl Run<'_> {
    /// Makes the pages hold the splats of the listed batches, and an eighth more for the next view.
    pub(super) fn look_for_slots(&mut self, part: Part) -> Result<()> {
        let lists = self.store.pages.iter().filter_map(|page| Some((page.buffer("drawn")?, 0)));
        let listed = self.timing.counts(self.gpu, &lists.collect::<Vec<_>>())?;
        for (number, [_, batches]) in listed.into_iter().enumerate() {
            let page = &self.store.pages[number];
            let slots = u64::from(batches) * u64::from(BATCH);
            if slots > page.slots {
                // Slots come in whole batches, because the partly filled last batch may be listed
                // anywhere.
                let [slots, all] = [slots + slots / 8, page.surfels].map(|n| n.next_multiple_of(BATCH.into()));
                self.store.grow(self.gpu, number, slots.min(all))?;
            }
        }
        self.known.slots = part == Part::Far;
        Ok(())
    }

    /// Makes the lists of a kind hold the entries that `stages` count, and a quarter more for the
    /// next view. If a binding or a list cannot hold the entries, large splats are drawn without
    /// lists. But tiles that gather all splats need lists: then this returns false, and the frame
    /// is retried without gathering.
    pub(super) fn look_for_lists(&mut self, of: Listed, stages: &[Stage]) -> Result<bool> {
        let gathers = self.plan.needs.surface.gathers();
        if of == Listed::Large && !gathers {
            let queues = self.store.pages.iter().filter_map(|page| Some((page.buffer("queue")?, 0)));
            let counted = self.timing.counts(self.gpu, &queues.collect::<Vec<_>>())?;
            let large = counted.iter().any(|[large, _]| *large > 0);
            // If lists cannot hold the large splats of one separate input, the large splats of all
            // inputs are drawn without lists, and later bands skip the count below.
            let large = large && !(self.plan.needs.surface.separate() && self.unlisted);
            self.by_tiles = large;
            if !large {
                return Ok(true);
            }
        }
        stages.iter().try_for_each(|stage| self.stage(stage))?;
        let Some(lists) = self.store.buffer(list_name(of)) else { return Ok(true) };
        let counted = self.timing.counts(self.gpu, &[(lists, 0)])?;
        let [entries, longest] = counted.first().copied().unwrap_or_default().map(u64::from);
        let entries = entries + entries / 4;
        let most = (self.gpu.buffer_limit() / 4).saturating_sub(self.store.list_words(self.plan, of));
        if entries > most || (self.gpu.adapter.is_software() && longest > LONGEST) {
            self.by_tiles = false;
            self.unlisted = true;
            self.known.crowded |= gathers;
            return Ok(!gathers);
        }
        // The entries of earlier bands have been drawn, so the lists may be replaced.
        if entries > self.store.entries(of) {
            self.store.make_lists(self.gpu, self.plan, of, entries)?;
        }
        let needed = &mut self.needed[of as usize];
        *needed = Some(needed.map_or(entries, |most| most.max(entries)));
        Ok(true)
    }

    /// Makes the buffers hold the counted fragments of a band. Returns false if the view must be
    /// retried: with smaller bands, because the fragments do not fit at once, or because a list is
    /// longer than the kernels are prepared for.
    pub(super) fn look_for_fragments(&mut self, band: usize) -> Result<bool> {
        self.timing.flush(self.gpu)?;
        let Some(starts) = self.store.buffer("starts") else { return Ok(true) };
        let rows = u64::from(self.plan.bands[band].rows);
        let mut words = starts.read(self.gpu, 2 + rows + 1)?;
        if let Some(among) = self.among {
            words = common(&words, among.exchange)?;
        }
        let [total, longest] = [words[0], words[1]];
        let ends_loops = self.gpu.adapter.is_software() && longest > long_lists::most_at_once(self.plan.needs.samples);
        if ends_loops && self.veil() {
            return Ok(false);
        }
        let record = u64::from(FragmentLayout::of(&self.plan.needs).words).max(KEY_WORDS);
        let most = self.gpu.buffer_limit().min(tuning::MOST_FRAGMENT_BYTES) / (4 * record);
        // The row starts wrap if the total exceeds a u32, and then no longer give the counts of
        // rows.
        if u64::from(total) <= most && total < u32::MAX {
            if ends_loops && longest > self.plan.longest_list {
                // Adds a quarter for the next view.
                self.known.longest_list = longest.saturating_add(longest / 4);
                self.known.times_cut += 1;
                return Ok(false);
            }
            self.store.make_fragments(self.gpu, self.plan, total.into(), most)?;
            return Ok(true);
        }
        let starts: Vec<u64> = words[2..].iter().map(|start| u64::from(*start)).collect();
        let cut = fragments::cut(self.plan, band, &starts, most);
        if cut.is_none() && self.veil() {
            return Ok(false);
        }
        self.known.times_cut += 1;
        self.known.cuts = Some(cut.ok_or_else(|| Error::Limit {
            adapter: self.gpu.adapter.name.clone(),
            limit: "max_storage_buffer_binding_size",
            available: self.gpu.buffer_limit(),
            needed: 4 * record * starts.windows(2).map(|row| row[1] - row[0]).max().unwrap_or(0),
            what: "for the fragments of one row of pixels; choose a narrower image, or --composite opaque".into(),
        })?);
        Ok(false)
    }
}

/// The number of all fragments, the greatest number at one pixel and the starts of rows, with which
/// all processes that draw a frame together have room: from the most fragments of each row.
fn common(words: &[u32], exchange: &dyn Exchange) -> Result<Vec<u32>> {
    let mut counts: Vec<u64> = words[2..].windows(2).map(|row| u64::from(row[1].saturating_sub(row[0]))).collect();
    counts.extend([u64::from(words[0]), u64::from(words[1])]);
    exchange.greatest(&mut counts)?;
    let (total, longest) = (counts[counts.len() - 2], counts[counts.len() - 1]);
    let mut sum = 0;
    let starts = counts[..counts.len() - 2].iter().map(|count| {
        sum += count;
        sum
    });
    let starts: Vec<u64> = std::iter::once(0).chain(starts).collect();
    let most = |count: u64| u32::try_from(count).unwrap_or(u32::MAX);
    let total = total.max(starts[starts.len() - 1]);
    Ok([total, longest].into_iter().chain(starts).map(most).collect())
}

impl Run<'_> {
    /// From the next try on, makes lists end where fragments behind do not show
    /// ([`veils`](crate::passes::veils)). Returns false if lists already do, or cannot.
    fn veil(&mut self) -> bool {
        let veils = self.plan.needs.surface.lists() == Some(Lists::Sorted) && !self.plan.needs.surface.veils();
        if veils {
            // Bands are cut anew by the shorter lists.
            (self.known.veiled, self.known.cuts) = (true, None);
            self.known.times_cut += 1;
        }
        veils
    }
}
