//! Chooses the cut of a scene with levels of detail on the device, branch by branch.

use super::run::{Run, over};
use crate::error::Result;
use crate::passes::select;

/// Surfel slots that may stay unused, beyond four times those that the cuts of all branches need:
/// the size of the cut changes from view to view.
const SPARE: u64 = 1 << 16;

impl Run<'_> {
    /// Chooses the surfels and nodes to draw in each branch, unless an earlier try already has.
    pub(super) fn select(&mut self) -> Result<()> {
        if self.known.chosen {
            return Ok(());
        }
        let (gpu, plan, store, kernels) = (self.gpu, self.plan, &*self.store, self.kernels);
        for (number, branch) in store.branches.iter().enumerate() {
            let clears = |encoder: &mut wgpu::CommandEncoder| {
                let of_all = store.buffer("reached").filter(|_| number == 0);
                let boxes = branch.buffers.get("boxes");
                of_all.into_iter().chain(boxes).for_each(|buffer| encoder.clear_buffer(&buffer.raw, 0, None));
            };
            self.timing.pass(gpu, "select", clears, |pass| {
                for run in select::choose(branch.large_levels) {
                    let program = kernels.of(gpu, &run.kernel)?;
                    let grid = over(gpu, plan, store, (0, 0), run.over)?;
                    let binding = |name: &str| store.binding_of_branch(name, number);
                    program.dispatch(gpu, pass, run.kernel.name, &binding, grid)?;
                }
                Ok(())
            })?;
        }
        self.known.chosen = true;
        Ok(())
    }

    /// Reads the sizes of the cuts and records the slots that the next try needs.
    pub(super) fn look_for_cut(&mut self) -> Result<()> {
        let chosen: Vec<_> = self.store.chosen().collect();
        let rooms = self.timing.counts(self.gpu, &chosen)?.into_iter().map(|[cut, _]| with_room(cut.into()));
        self.make_room(rooms.collect());
        Ok(())
    }

    /// Returns whether `rooms`, the slots of each branch, suffice for `cuts`, the sizes of the
    /// branches' cuts. If there are too few slots, or far too many, the next try gets the slots
    /// that the cuts need.
    pub(super) fn fits_cut(&mut self, rooms: &[u64], cuts: &[u64]) -> bool {
        let enough: Vec<u64> = cuts.iter().copied().map(with_room).collect();
        let fits = rooms.iter().zip(cuts).all(|(room, cut)| cut <= room);
        if !fits {
            // Branches that fit keep their slots, so that views of many branches do not reallocate
            // again and again.
            let larger = rooms.iter().zip(cuts).zip(enough);
            self.make_room(larger.map(|((room, cut), enough)| if cut > room { enough } else { *room }).collect());
        } else if rooms.iter().sum::<u64>() > 4 * enough.iter().sum::<u64>() + SPARE {
            self.make_room(enough);
        }
        fits
    }

    /// Sets the slots of each branch; the next try allocates new pages for them.
    fn make_room(&mut self, mut rooms: Vec<u64>) {
        // If nothing is drawn, one page must still exist.
        if let (true, Some(first)) = (rooms.iter().all(|room| *room == 0), rooms.first_mut()) {
            *first = 1;
        }
        self.known.cut = Some(rooms);
        // New pages have no slots yet.
        self.known.slots = false;
    }
}

/// Adds an eighth to the size of a cut as a reserve for the next view.
fn with_room(cut: u64) -> u64 {
    cut + cut / 8
}
