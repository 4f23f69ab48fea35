//! The buffers of each page of surfels and of each branch of an octree.

use bytemuck::Zeroable;

use super::store::{Named, kept};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::gpu::buffers::Buffer;
use crate::gpu::layout::{self, BATCH, JUDGED, LIST_START, QUEUE_START, SPREAD_GRID, WORKGROUP};
use crate::passes::order;
use crate::passes::upload::{self, BranchBuffers};
use crate::plan::{SceneNeeds, splat_words};

/// One page of surfels, with slots for their splats. Without culling there is a slot for each
/// surfel, in the surfels' order. With culling there are slots only for the batches that are drawn,
/// one batch after the other ([`cull`](crate::passes::cull)).
pub struct Page {
    pub(super) buffers: Named,
    /// If the page is of a cut, the index of the branch that stores the surfels and their
    /// attributes.
    pub(super) branch: Option<usize>,
    /// Number of surfels in the page; in a page of a cut, number of its slots.
    pub surfels: u64,
    /// Number of scene surfels that the page stands for, copies included; copies are stored once.
    pub stand_for: u64,
    /// u32 words of a splat's record.
    splat_words: u64,
    /// Number of splats that the buffers can hold.
    pub slots: u64,
}

impl Page {
    pub(super) fn new(gpu: &Gpu, uploaded: upload::Page, first: u32, needs: &SceneNeeds) -> Result<Self> {
        let upload::Page { buffers, numbers, stand_for } = uploaded;
        let own = layout::Page { first, surfels: numbers.len() as u32, ..Zeroable::zeroed() };
        Self::with(gpu, Named::from_iter(buffers), (None, stand_for), (own, needs))
    }

    /// Creates a page for up to `surfels` surfels of the cut of a branch, starting at number
    /// `first` of the cut. The device stores how many surfels the cut has.
    pub(super) fn of_cut(
        gpu: &Gpu,
        surfels: u64,
        (number, branch, first): (usize, &Branch, u64),
        needs: &SceneNeeds,
    ) -> Result<Self> {
        Self::with(gpu, Named::new(), (Some(number), 0), (order::dealt(surfels, (branch.chosen, first as u32)), needs))
    }

    /// Creates a page with `buffers`; its splat buffers are minimal until [`Self::grow`].
    fn with(
        gpu: &Gpu,
        mut buffers: Named,
        (branch, stand_for): (Option<usize>, u64),
        (own, needs): (layout::Page, &SceneNeeds),
    ) -> Result<Self> {
        let surfels = u64::from(own.surfels);
        buffers.insert("page", Buffer::uniform(gpu, "page", &own)?.words());
        let batches = surfels.div_ceil(BATCH.into());
        let drawn = Buffer::indirect(gpu, "batches that are drawn", batches + u64::from(LIST_START))?;
        // One row of the dispatch grid is one batch.
        drawn.put(gpu, bytemuck::cast_slice(&[[BATCH / WORKGROUP, 0, 1]; 2]));
        buffers.insert("drawn", drawn);
        buffers.insert("rest", Buffer::storage(gpu, "batches that may be drawn", batches + 1)?);
        // A binding must hold at least one record.
        buffers.insert("splats", Buffer::storage(gpu, "splats", splat_words(needs))?);
        for (name, what) in [("queue", "queue of large splats"), ("rare", "list of rare splats")] {
            buffers.insert(name, Buffer::indirect(gpu, what, QUEUE_START.into())?);
        }
        Ok(Self { buffers, branch, surfels, stand_for, splat_words: splat_words(needs), slots: 0 })
    }

    /// Number of batches, the last one perhaps partly filled.
    pub fn batches(&self) -> u64 {
        self.surfels.div_ceil(BATCH.into())
    }

    /// The buffer of this name in WGSL.
    pub fn buffer(&self, name: &str) -> Option<&Buffer<u32>> {
        self.buffers.get(kept(name))
    }

    /// Grows the buffers to at least `slots` splats and keeps their contents.
    pub(super) fn grow(&mut self, gpu: &Gpu, slots: u64) -> Result<()> {
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

/// A branch of an octree ([`branches`](crate::passes::branches)).
pub struct Branch {
    pub(super) buffers: Named,
    /// Number of levels that are too large for one workgroup.
    pub large_levels: u32,
    /// Word offset in `attributes` at which the list of chosen surfels and nodes starts.
    pub(super) chosen: u32,
}

/// Creates the buffers that all branches share while their cuts are made one after the other.
pub(super) fn of_selection(gpu: &Gpu, branches: &[BranchBuffers], needs: &SceneNeeds) -> Result<Named> {
    let nodes = branches.iter().map(|branch| branch.nodes).max().unwrap_or(0);
    let roots = branches.iter().map(|branch| branch.roots).sum();
    let runs = nodes.div_ceil(JUDGED.into());
    let groups = runs.div_ceil(WORKGROUP.into());
    // With fades, the second half stores how many cuts reach each node.
    let halves = if needs.fades { 2 } else { 1 };
    Ok(Named::from([
        ("selection", Buffer::indirect(gpu, "state of a cut", u64::from(SPREAD_GRID) + 3)?),
        ("frontier", Buffer::storage(gpu, "nodes that a cut comes to", halves * nodes)?),
        ("fates", Buffer::storage(gpu, "what becomes of nodes", nodes)?),
        ("counts_of", Buffer::<[u32; 2]>::storage(gpu, "counts of a level", groups + runs)?.words()),
        ("reached", Buffer::storage(gpu, "branches that a cut comes to", roots)?),
    ]))
}
