//! The cut of a scene with levels of detail, on a device: branch by branch, and then page by page.

use super::run::{Run, over};
use crate::error::Result;
use crate::gpu::buffers::counts;
use crate::passes::select;

/// Room that may be left unused before it is given back: what a view asks for changes from one to the next.
const SPARE: u64 = 1 << 16;

impl Run<'_> {
    /// Chooses what is drawn of each branch, and copies it to the pages if it is `gathered`.
    pub(super) fn select(&mut self, gathered: bool) -> Result<()> {
        let (gpu, plan, store, kernels) = (self.gpu, self.plan, &*self.store, self.kernels);
        for (number, branch) in store.branches.iter().enumerate() {
            let clears = |encoder: &mut wgpu::CommandEncoder| {
                let of_all = ["selection", "reached"].into_iter().filter(|_| number == 0);
                of_all
                    .filter_map(|name| store.buffer(name))
                    .for_each(|buffer| encoder.clear_buffer(&buffer.raw, 0, None));
            };
            self.timing.pass(gpu, "select", clears, |pass| {
                let chosen = select::choose(branch.levels).into_iter().map(|run| (run, 0));
                let pages = 0..if gathered { store.pages.len() } else { 0 };
                let copied = pages.flat_map(|page| select::GATHER.map(|run| (run, page)));
                for (run, page) in chosen.chain(copied) {
                    let program = kernels.of(gpu, &run.kernel)?;
                    let grid = over(gpu, plan, store, (0, page), run.over)?;
                    let binding = |name: &str| store.binding_of_branch(name, number, page);
                    program.dispatch(gpu, pass, run.kernel.name, &binding, grid)?;
                }
                Ok(())
            })?;
        }
        if !(gathered && plan.needs.cull) {
            return Ok(());
        }
        let program = kernels.of(gpu, &select::BALLS.kernel)?;
        self.timing.pass(
            gpu,
            "select",
            |_| {},
            |pass| {
                (0..store.pages.len()).try_for_each(|page| {
                    let grid = over(gpu, plan, store, (0, page), select::BALLS.over)?;
                    let binding = |name: &str| store.binding(name, page, 0);
                    program.dispatch(gpu, pass, select::BALLS.kernel.name, &binding, grid)
                })
            },
        )
    }

    /// Learns how large the cut is.
    pub(super) fn look_for_cut(&mut self) -> Result<()> {
        self.timing.flush(self.gpu)?;
        let Some(selection) = self.store.buffer("selection") else { return Ok(()) };
        let [cut, _] = counts(self.gpu, &[selection])?.first().copied().unwrap_or_default();
        self.make_room(cut.into());
        Ok(())
    }

    /// Whether pages with `room` for so many surfels have room for a cut; if not, or if it is far too much, the next try has as much as it takes.
    pub(super) fn fits_cut(&mut self, room: u64, cut: u64) -> bool {
        if cut > room || room > 4 * with_room(cut) + SPARE {
            self.make_room(cut);
        }
        cut <= room
    }

    /// From the next try on; its pages are new ones.
    fn make_room(&mut self, cut: u64) {
        (self.known.cut, self.known.slots) = (Some(with_room(cut)), false);
    }
}

/// An eighth more than this view takes, for the next one; and where nothing is drawn, a page.
fn with_room(cut: u64) -> u64 {
    (cut + cut / 8).max(1)
}
