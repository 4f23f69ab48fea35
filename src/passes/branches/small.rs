//! The small levels of a branch, which one workgroup judges and spreads in one dispatch
//! (`select_top` in `wgsl/levels/select.wgsl`).

use super::MOST_OF_LEAF;
use super::row::{COUNT_MASK, Row};
use crate::gpu::layout::{JUDGED, WORKGROUP};

/// The total rounds of all loops of an invocation after which llvmpipe ends it, even if it is not
/// done.
pub(super) const MOST_ROUNDS: u64 = 65_535;

/// The most rounds in which an invocation judges and spreads its nodes of a level, if none has more
/// than `below` surfels or children.
///
/// Each node takes one round per surfel or child, and at most nine more to reach the node, to end
/// loops, and to sum.
pub(super) const fn rounds_of(below: u32) -> u64 {
    JUDGED as u64 * (below as u64 + 9)
}

const _: () = assert!(rounds_of(MOST_OF_LEAF) < MOST_ROUNDS);

/// Counts the top levels of a branch that are small
/// ([`Branch::small_levels`](super::Branch::small_levels)).
pub(super) struct Small {
    /// The number of small levels so far.
    pub levels: u32,
    /// The most rounds in which an invocation processes them.
    rounds: u64,
    /// Whether the next level is not small.
    ended: bool,
}

impl Small {
    /// Starts with a branch of `roots` roots: one invocation visits them all, in one round each.
    pub fn of(roots: u64) -> Self {
        Self { levels: 0, rounds: roots, ended: false }
    }

    /// Adds the next level.
    pub fn add(&mut self, level: &[Row]) {
        if self.ended || level.len() > (JUDGED * WORKGROUP) as usize {
            self.ended = true;
            return;
        }
        let below = level.iter().map(|row| row.below & COUNT_MASK).max().unwrap_or(0);
        self.rounds += rounds_of(below);
        self.ended = self.rounds >= MOST_ROUNDS;
        self.levels += u32::from(!self.ended);
    }
}
