//! Compares what the device counted in a band with the sizes of the buffers that it is for.

use super::store::Store;
use crate::gpu::buffers::Buffer;
use crate::gpu::layout::BATCH;
use crate::passes::long_lists;
use crate::passes::tiles::{LONGEST, list_name};
use crate::plan::Plan;
use crate::plan::known::Listed;

/// Reasons for which a frame is incomplete, as bits.
pub(super) mod lacks {
    /// Slots for splats.
    pub const SLOTS: u32 = 1;
    /// Entries of the lists of splats.
    pub const LISTS: u32 = 2;
    /// Slots for the cut.
    pub const CUT: u32 = 4;
    /// Bits of sums: some wrapped.
    pub const BITS: u32 = 8;
    /// Places of fragments.
    pub const FRAGMENTS: u32 = 16;
}

/// Sizes of the buffers of a frame, as far as the device counts what they need.
pub(super) struct Capacities {
    /// For each page the scene surfels that it stands for, and its splat slots.
    pages: Vec<[u64; 2]>,
    culls: bool,
    /// The kinds of lists that a band has, with their entries.
    lists: Vec<(Listed, u64)>,
    /// Whether the device counts one-word sums that wrap.
    wraps: bool,
    /// Surfel slots for the cut, by branch.
    cut: Option<Vec<u64>>,
    /// Fragments that fit, and the longest list that the kernels are prepared for.
    fragments: Option<[u64; 2]>,
}

/// The counts of a band.
pub(super) struct Counted {
    /// Splats that may touch a pixel and are not known to be hidden.
    pub drawn: u64,
    /// The sizes of the branches' cuts.
    pub cuts: Option<Vec<u64>>,
    /// Whether there are large splats.
    pub large: bool,
    /// The bits of [`lacks`] that the counts set.
    pub lacking: u32,
    /// Fragments that made a sum wrap.
    pub overflows: u64,
}

impl Capacities {
    /// The sizes of the buffers that `plan` has in `store`; `by_tiles` if large splats are listed.
    pub fn of(plan: &Plan, store: &Store, by_tiles: bool) -> Self {
        let had = |of: Listed, wanted: bool| {
            (wanted && store.buffer(list_name(of)).is_some()).then(|| (of, store.entries(of)))
        };
        let lists = [had(Listed::Large, by_tiles), had(Listed::Small, plan.needs.surface.gathers())];
        Self {
            pages: store.pages.iter().map(|page| [page.stand_for, page.slots]).collect(),
            culls: plan.needs.cull,
            lists: lists.into_iter().flatten().collect(),
            wraps: plan.sum_words > 0 && plan.needs.accumulator.row().head_words() > 0,
            cut: plan.cut.clone(),
            fragments: None,
        }
    }

    /// These sizes with those of the fragments, which other frames read before they are listed.
    pub fn with_fragments(self, plan: &Plan, store: &Store, is_software: bool) -> Self {
        if plan.needs.surface.lists().is_none() {
            return self;
        }
        let most_at_once = long_lists::most_at_once(plan.needs.samples);
        let longest = if is_software { plan.longest_list.max(most_at_once) } else { u32::MAX - 1 };
        Self { fragments: Some([store.fragments().min(u64::from(u32::MAX) - 1), longest.into()]), ..self }
    }

    /// The buffers that count what a band needed, in two words each, from the given word on.
    pub fn counters<'a>(&self, store: &'a Store) -> Vec<(&'a Buffer<u32>, u64)> {
        let of_pages = store.pages.iter().flat_map(|page| [page.buffer("queue"), page.buffer("drawn")]);
        let lists = self.lists.iter().map(|(of, _)| store.buffer(list_name(*of)));
        let sums = store.buffer("sums").filter(|_| self.wraps);
        let chosen = store.chosen().filter(|_| self.cut.is_some());
        let starts = store.buffer("starts").filter(|_| self.fragments.is_some());
        let before = of_pages.chain(lists).chain([sums]).flatten().map(|buffer| (buffer, 0));
        before.chain(chosen).chain(starts.map(|starts| (starts, 0))).collect()
    }

    /// For each of the [`counters`](Self::counters) the largest counts of a complete frame, and the
    /// bit of [`lacks`] that larger ones set.
    pub fn limits(&self) -> Vec<[u32; 4]> {
        let most = |size: u64| u32::try_from(size).unwrap_or(u32::MAX);
        let any = [u32::MAX, u32::MAX, 0, 0];
        let of_pages = self.pages.iter().flat_map(|[_, slots]| {
            let batches = if self.culls { most(slots / u64::from(BATCH)) } else { u32::MAX };
            [any, [u32::MAX, batches, lacks::SLOTS, 0]]
        });
        let lists = self.lists.iter().map(|(_, entries)| [most(*entries), most(LONGEST), lacks::LISTS, 0]);
        let sums = self.wraps.then_some([0, u32::MAX, lacks::BITS, 0]);
        let cuts = self.cut.iter().flatten().map(|room| [most(*room), u32::MAX, lacks::CUT, 0]);
        let fragments = self.fragments.map(|[places, longest]| [most(places), most(longest), lacks::FRAGMENTS, 0]);
        of_pages.chain(lists).chain(sums).chain(cuts).chain(fragments).collect()
    }

    /// Compares the words of the [`counters`](Self::counters) with the sizes.
    pub fn compared(&self, counted: &[[u32; 2]]) -> Counted {
        let over = |([first, second], [most_first, most_second, bit, _]): (&[u32; 2], [u32; 4])| {
            if *first > most_first || *second > most_second { bit } else { 0 }
        };
        let lacking = counted.iter().zip(self.limits()).map(over).fold(0, |all, bit| all | bit);
        let mut counted = counted.iter().copied();
        let mut next = || counted.next().unwrap_or_default();
        let (mut drawn, mut large, mut unseen_in_all) = (0, false, 0);
        for [stand_for, _] in &self.pages {
            let ([of_large, unseen], _) = (next(), next());
            drawn += stand_for.saturating_sub(unseen.into());
            unseen_in_all += u64::from(unseen);
            large |= of_large > 0;
        }
        for _ in &self.lists {
            next();
        }
        let overflows = if self.wraps { next()[0].into() } else { 0 };
        let cuts = self.cut.as_ref().map(|rooms| rooms.iter().map(|_| next()[0].into()).collect::<Vec<u64>>());
        if let Some(cuts) = &cuts {
            drawn += cuts.iter().sum::<u64>().saturating_sub(unseen_in_all);
        }
        Counted { drawn, cuts, large, lacking, overflows }
    }
}
