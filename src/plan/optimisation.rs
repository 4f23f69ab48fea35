//! What makes frames faster and changes no bit of them. All of it is on; a study leaves one out to show what it is worth.

use std::str::FromStr;

use crate::error::Error;

/// Something that no image depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Optimisation {
    /// Batches of surfels that are out of view or hidden are not projected, but of cuts (`passes/cull.rs`).
    Culling,
    /// Surfels are stored along a Morton curve, in runs that are dealt out (`passes/order.rs`).
    Order,
    /// Splats that lie behind all nearest depths of their pixels add nothing and are left out (`wgsl/occlusion.wgsl`).
    Hiding,
    /// Surfels that are the same are drawn once (`scene/copies.rs`).
    Copies,
    /// Two sums share a 64-bit word, which one atomic addition serves (`wgsl/accumulator_fixed_pairs.wgsl`), or the nearest depth and its
    /// colour do (`wgsl/nearest_color.wgsl`).
    Pairs,
    /// Records are read and written 64 bits at a time (`wgsl/words_long.wgsl`).
    LongWords,
    /// Tiles sum small splats too (`passes/tiles.rs`).
    Gathering,
    /// The invocations of a tile share what they fetch (`wgsl/splat_shared.wgsl`).
    Sharing,
    /// Loops that are known to end are not counted (`gpu/loops.rs`).
    UncountedLoops,
}

impl Optimisation {
    /// Every one and its name.
    pub const ALL: [(Self, &'static str); 9] = [
        (Self::Culling, "culling"),
        (Self::Order, "order"),
        (Self::Hiding, "hiding"),
        (Self::Copies, "copies"),
        (Self::Pairs, "pairs"),
        (Self::LongWords, "long-words"),
        (Self::Gathering, "gathering"),
        (Self::Sharing, "sharing"),
        (Self::UncountedLoops, "uncounted-loops"),
    ];
}

impl FromStr for Optimisation {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let known = Self::ALL.iter().find(|(_, name)| *name == text);
        known.map(|(optimisation, _)| *optimisation).ok_or_else(|| {
            let names = Self::ALL.map(|(_, name)| name).join(", ");
            Error::Usage(format!("there is no optimisation {text:?}: take {names}"))
        })
    }
}
