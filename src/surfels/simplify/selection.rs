//! Splat selection: repeatedly takes the splat that adds the largest area, until every cell is
//! covered.
//!
//! The contribution `Q` of a splat is the area that it covers and no selected splat does (thesis
//! section 4.3, Eq. 2). Finding the smallest set is NP-hard; the greedy set is at most `1 + ln n`
//! times as large, with n pieces in the largest splat.

use std::collections::BinaryHeap;

use super::candidates::Candidates;
use super::cells::Cells;
use crate::Progress;

/// A splat and its contribution when it was last computed. Contributions only shrink, so the top of
/// the heap is the best splat if its contribution is up to date. Most contributions are never
/// computed again.
#[derive(PartialEq)]
struct Entry {
    contribution: f64,
    splat: u32,
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.contribution.total_cmp(&other.contribution).then(other.splat.cmp(&self.splat))
    }
}

/// The selected splats, ascending.
pub(super) fn select(cells: &Cells, candidates: &Candidates, progress: &dyn Progress) -> Vec<u32> {
    let cell_count = cells.radii.len() as u32;
    progress.begin("selecting splats", cell_count.into());
    let mut missing: Vec<u16> = (0..cell_count).map(|cell| cells.pieces(cell)).collect();
    let whole: Vec<f64> = (0..cell_count).map(|cell| cells.area(cell, missing[cell as usize])).collect();
    let contribution = |splat: u32, missing: &[u16]| -> f64 {
        let area = |cover: &super::growing::Cover| {
            let adds = cover.pieces & missing[cover.cell as usize];
            match adds {
                0 => 0.0,
                adds if adds == cells.pieces(cover.cell) => whole[cover.cell as usize],
                adds => cells.area(cover.cell, adds),
            }
        };
        candidates.covers(splat).iter().map(area).sum()
    };
    let count = candidates.splats.len() as u32;
    let mut heap: BinaryHeap<Entry> =
        (0..count).map(|splat| Entry { contribution: contribution(splat, &missing), splat }).collect();
    let mut selected = Vec::new();
    while let Some(Entry { contribution: before, splat }) = heap.pop() {
        let now = Entry { contribution: contribution(splat, &missing), splat };
        if now.contribution < before && heap.peek().is_some_and(|next| *next > now) {
            if now.contribution > 0.0 {
                heap.push(now);
            }
            continue;
        }
        if now.contribution <= 0.0 {
            continue;
        }
        let mut done = 0;
        for cover in candidates.covers(splat) {
            let cell = &mut missing[cover.cell as usize];
            let before = *cell;
            *cell &= !cover.pieces;
            done += u64::from(before != 0 && *cell == 0);
        }
        progress.advance(done);
        selected.push(splat);
    }
    progress.end();
    selected.sort_unstable();
    selected
}
