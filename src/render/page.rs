//! What of the buffers there is for each page of surfels, and for each branch of a tree.

use bytemuck::Zeroable;

use super::store::{Named, kept};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::layout::{self, BATCH, JUDGED, LIST_START, QUEUE_START, SPREAD_GRID, WORKGROUP};
use crate::passes::order;
use crate::passes::upload::{self, BranchBuffers};
use crate::plan::{SceneNeeds, splat_words};

/// One page: its surfels, and slots for splats of all of them, in their order, or, where batches are left out, of as many batches as
/// there are to be drawn, one after the other ([`cull`](crate::passes::cull)).
pub struct Page {
    pub(super) buffers: Named,
    /// The number of the branch that has the surfels and their attributes, if they are those of a cut.
    pub(super) branch: Option<usize>,
    /// Surfels in it.
    pub surfels: u64,
    /// Surfels that they stand for together.
    pub stand_for: u64,
    /// Words of a splat's record.
    splat_words: u64,
    /// Splats that there is room for.
    pub slots: u64,
}

impl Page {
    pub(super) fn new(gpu: &Gpu, uploaded: upload::Page, first: u32, needs: &SceneNeeds) -> Result<Self> {
        let upload::Page { buffers, numbers, stand_for } = uploaded;
        let own = layout::Page { first, surfels: numbers.len() as u32, ..Zeroable::zeroed() };
        Self::with(gpu, Named::from_iter(buffers), (None, stand_for), (own, needs))
    }

    /// One with room for so many surfels of the cut of a branch, from the one with the number `first` on: how many of them there are, that cut tells.
    pub(super) fn of_cut(
        gpu: &Gpu,
        surfels: u64,
        (number, branch, first): (usize, &Branch, u64),
        needs: &SceneNeeds,
    ) -> Result<Self> {
        Self::with(gpu, Named::new(), (Some(number), 0), (order::dealt(surfels, (branch.chosen, first as u32)), needs))
    }

    /// One with these buffers, and room for nothing yet of what is made of them.
    fn with(
        gpu: &Gpu,
        mut buffers: Named,
        (branch, stand_for): (Option<usize>, u64),
        (own, needs): (layout::Page, &SceneNeeds),
    ) -> Result<Self> {
        let surfels = u64::from(own.surfels);
        buffers.insert("page", Buffer::uniform(gpu, "page", &own)?.words());
        // Those of cuts are drawn one and all.
        let batches = if branch.is_some() { 0 } else { surfels.div_ceil(BATCH.into()) };
        let drawn = Buffer::indirect(gpu, "batches that are drawn", batches + u64::from(LIST_START))?;
        // A row of a grid is a batch.
        gpu.queue.write_buffer(&drawn.raw, 0, bytemuck::cast_slice(&[[BATCH / WORKGROUP, 0, 1]; 2]));
        buffers.insert("drawn", drawn);
        buffers.insert("rest", Buffer::storage(gpu, "batches that may be drawn", batches + 1)?);
        // A binding holds one record at least.
        buffers.insert("splats", Buffer::storage(gpu, "splats", splat_words(needs))?);
        for (name, what) in [("queue", "queue of large splats"), ("rare", "list of rare splats")] {
            buffers.insert(name, Buffer::indirect(gpu, what, QUEUE_START.into())?);
        }
        Ok(Self { buffers, branch, surfels, stand_for, splat_words: splat_words(needs), slots: 0 })
    }

    /// Batches of surfels.
    pub fn batches(&self) -> u64 {
        self.surfels.div_ceil(BATCH.into())
    }

    /// The buffer of a name.
    pub fn buffer(&self, name: &str) -> Option<&Buffer<u32>> {
        self.buffers.get(kept(name))
    }

    /// Makes room for at least `slots` splats, and keeps all that is stored.
    pub fn grow(&mut self, gpu: &Gpu, slots: u64) -> Result<()> {
        if self.slots >= slots {
            return Ok(());
        }
        let list = slots + u64::from(QUEUE_START);
        for (name, what, words) in [
            ("splats", "splats", slots * self.splat_words),
            ("queue", "queue of large splats", list),
            ("rare", "list of rare splats", list),
        ] {
            if let Some(buffer) = self.buffers.get_mut(name) {
                buffer.grow(gpu, what, words)?;
            }
        }
        self.slots = slots;
        Ok(())
    }
}

/// A branch of a tree ([`branches`](crate::passes::branches)).
pub struct Branch {
    pub(super) buffers: Named,
    /// How many levels it has that one workgroup cannot judge.
    pub large_levels: u32,
    /// Where in its attributes what is chosen starts, words.
    pub(super) chosen: u32,
}

/// What all branches share while a cut is made, one after the other.
pub(super) fn of_selection(gpu: &Gpu, branches: &[BranchBuffers], needs: &SceneNeeds) -> Result<Named> {
    let nodes = branches.iter().map(|branch| branch.nodes).max().unwrap_or(0);
    let roots = branches.iter().map(|branch| branch.roots).sum();
    let runs = nodes.div_ceil(JUDGED.into());
    let groups = runs.div_ceil(WORKGROUP.into());
    // In the second one, by how many cuts what is in the first is come to.
    let halves = if needs.fades { 2 } else { 1 };
    Ok(Named::from([
        ("selection", Buffer::indirect(gpu, "state of a cut", u64::from(SPREAD_GRID) + 3)?),
        ("frontier", Buffer::storage(gpu, "nodes that a cut comes to", halves * nodes)?),
        ("fates", Buffer::storage(gpu, "what becomes of nodes", nodes)?),
        ("run_counts", Buffer::<[u32; 2]>::storage(gpu, "counts of a level", runs)?.words()),
        ("group_counts", Buffer::<[u32; 2]>::storage(gpu, "counts of a cut", groups)?.words()),
        ("reached", Buffer::storage(gpu, "branches that a cut comes to", roots)?),
    ]))
}
