//! The small levels of a branch, which one workgroup judges and spreads in one dispatch
//! (`select_top` in `wgsl/levels/select.wgsl`).

use super::MOST_OF_LEAF;
use super::row::{COUNT_MASK, Row};
use crate::gpu::layout::{JUDGED, WORKGROUP};

/// The rounds of all its loops after which llvmpipe ends an invocation, whatever is left to do.
pub(super) const MOST_ROUNDS: u64 = 65_535;

/// The most rounds in which an invocation judges and spreads its nodes of a level, if none has more
/// than `below` surfels or children.
///
/// Each node takes one round for each of these, and at most nine for reaching it, the ends of
/// loops, and sums.
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
    /// Starts with a branch of so many roots, which one invocation visits.
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
