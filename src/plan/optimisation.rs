//! Optimisations that make frames faster without changing a bit of them. All are on; a study turns
//! one off to measure its effect.

use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::Error;

/// An optimisation on which no image depends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Optimisation {
    /// Batches of surfels that are out of view or hidden are not projected (`passes/cull.rs`).
    Culling,
    /// Surfels are stored along a Morton curve, in runs that are dealt out over the scene
    /// (`passes/order.rs`).
    Order,
    /// Splats that lie behind all nearest depths of their pixels are skipped, since they add
    /// nothing (`wgsl/visibility/occlusion.wgsl`).
    Hiding,
    /// Identical surfels are drawn once (`scene/copies.rs`).
    Copies,
    /// Two values share a 64-bit word, which one atomic operation serves: two sums
    /// (`wgsl/accumulate/accumulator_fixed_pairs.wgsl`), or the nearest depth and its colour
    /// (`wgsl/visibility/nearest_color.wgsl`).
    Pairs,
    /// Graphics cards spread the fragments of a workgroup's splats over its invocations and sum
    /// them in its memory first (`wgsl/accumulate/accumulate_spread.wgsl`).
    Spreading,
    /// Records are read and written 64 bits at a time (`wgsl/common/words_long.wgsl`).
    LongWords,
    /// Tiles sum small splats too (`passes/tiles.rs`).
    Gathering,
    /// The invocations of a tile share what they fetch (`wgsl/tiles/splat_shared.wgsl`).
    Sharing,
    /// Processors project and draw splats by two kernels (`passes/project.rs`). Graphics cards use
    /// one, which saves a dispatch and the reading of all records.
    Splitting,
    /// Loops that are proved to end have no counters (`gpu/loops.rs`).
    UncountedLoops,
    /// Processors divide, take roots and convert integers by their own instructions, which round to
    /// nearest as the functions of `wgsl/common/arithmetic.wgsl` do (`gpu/exact`).
    Division,
}

impl Optimisation {
    /// Every optimisation and its name.
    pub const ALL: [(Self, &'static str); 12] = [
        (Self::Culling, "culling"),
        (Self::Order, "order"),
        (Self::Hiding, "hiding"),
        (Self::Copies, "copies"),
        (Self::Pairs, "pairs"),
        (Self::Spreading, "spreading"),
        (Self::LongWords, "long-words"),
        (Self::Gathering, "gathering"),
        (Self::Sharing, "sharing"),
        (Self::Splitting, "splitting"),
        (Self::UncountedLoops, "uncounted-loops"),
        (Self::Division, "division"),
    ];
}

impl FromStr for Optimisation {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let known = Self::ALL.iter().find(|(_, name)| *name == text);
        known.map(|(optimisation, _)| *optimisation).ok_or_else(|| {
            let names = Self::ALL.map(|(_, name)| name).join(", ");
            Error::Usage(format!("there is no optimisation {text:?}: take one of {names}"))
        })
    }
}
