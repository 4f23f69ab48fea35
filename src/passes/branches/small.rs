//! Levels of branches that are small, which one workgroup judges and spreads in one dispatch (`select_top` in `wgsl/select.wgsl`).

use super::MOST_OF_LEAF;
use super::row::{COUNT_MASK, Row};
use crate::gpu::layout::{JUDGED, WORKGROUP};

/// Rounds of all its loops after which llvmpipe ends an invocation, whatever is left to do.
pub(super) const MOST_ROUNDS: u64 = 65_535;

/// The most rounds in which an invocation judges and spreads its nodes of a level, of which none has more than so many surfels or children: of each node
/// one for each of these, and no more than nine in which it is come to, loops end, and sums are made.
pub(super) const fn rounds_of(below: u32) -> u64 {
    JUDGED as u64 * (below as u64 + 9)
}

const _: () = assert!(rounds_of(MOST_OF_LEAF) < MOST_ROUNDS);

/// The first levels of a branch that are small ([`Branch::small_levels`]).
pub(super) struct Small {
    /// How many there are.
    pub levels: u32,
    /// In which an invocation goes through them.
    rounds: u64,
    /// The next one is none of them.
    ended: bool,
}

impl Small {
    /// Of a branch with so many roots, to which one invocation comes.
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
