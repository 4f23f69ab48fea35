//! The cut of a scene with levels of detail, on a device: branch by branch.

use super::run::{Run, over};
use crate::error::Result;
use crate::gpu::buffers::counts_at;
use crate::passes::select;

/// Room that may be left unused before it is given back: what a view asks for changes from one to the next.
const SPARE: u64 = 1 << 16;

impl Run<'_> {
    /// Chooses what is drawn of each branch.
    pub(super) fn select(&mut self) -> Result<()> {
        if self.known.chosen {
            return Ok(());
        }
        let (gpu, plan, store, kernels) = (self.gpu, self.plan, &*self.store, self.kernels);
        for (number, branch) in store.branches.iter().enumerate() {
            let clears = |encoder: &mut wgpu::CommandEncoder| {
                let of_all = store.buffer("reached").filter(|_| number == 0);
                of_all.into_iter().for_each(|buffer| encoder.clear_buffer(&buffer.raw, 0, None));
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

    /// Learns how large the cut is.
    pub(super) fn look_for_cut(&mut self) -> Result<()> {
        self.timing.flush(self.gpu)?;
        let chosen: Vec<_> = self.store.chosen().collect();
        let rooms = counts_at(self.gpu, &chosen)?.into_iter().map(|[cut, _]| with_room(cut.into()));
        self.make_room(rooms.collect());
        Ok(())
    }

    /// Whether pages with `rooms` for so many surfels of each branch have room for its cut; if not, or if it is far too much, the next try has as much as
    /// it takes.
    pub(super) fn fits_cut(&mut self, rooms: &[u64], cuts: &[u64]) -> bool {
        let enough: Vec<u64> = cuts.iter().copied().map(with_room).collect();
        let fits = rooms.iter().zip(cuts).all(|(room, cut)| cut <= room);
        if !fits {
            // What has room keeps it, so that views of many branches do not make room again and again.
            let larger = rooms.iter().zip(cuts).zip(enough);
            self.make_room(larger.map(|((room, cut), enough)| if cut > room { enough } else { *room }).collect());
        } else if rooms.iter().sum::<u64>() > 4 * enough.iter().sum::<u64>() + SPARE {
            self.make_room(enough);
        }
        fits
    }

    /// From the next try on; its pages are new ones.
    fn make_room(&mut self, mut rooms: Vec<u64>) {
        // Where nothing is drawn, a page.
        if let (true, Some(first)) = (rooms.iter().all(|room| *room == 0), rooms.first_mut()) {
            *first = 1;
        }
        self.known.cut = Some(rooms);
    }
}

/// An eighth more than this view takes, for the next one.
fn with_room(cut: u64) -> u64 {
    cut + cut / 8
}
