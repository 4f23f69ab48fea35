//! The room that a surfel and its splat take, beside the surfel's shape.

use super::{ColorNeed, SceneNeeds};
use crate::gpu::layout::{Filter, Splat};
use crate::scene::LowPass;

/// Where a surfel's attributes lie in its record, by word. What is not needed takes no room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfelLayout {
    /// Words of a record; the colour comes first, a place in a texture after it.
    pub words: u32,
    /// How many surfels it stands for.
    pub copies: u32,
    /// The first of the three trailing parts of its centre.
    pub low: u32,
}

impl SurfelLayout {
    /// The layout for `needs`.
    pub fn of(needs: &SceneNeeds) -> Self {
        let copies = match needs.color {
            ColorNeed::Constant => 0,
            ColorNeed::Srgb8 => 1,
            ColorNeed::Linear => 4,
            // A colour, a place and two slopes.
            ColorNeed::Textured => 16,
        };
        let low = copies + u32::from(needs.copies);
        Self { words: low + if needs.doubled { 3 } else { 0 }, copies, low }
    }
}

/// Words of a splat's record, of which those of its low-pass come last.
pub fn splat_words(low_pass: LowPass) -> u64 {
    let filter = if low_pass == LowPass::None { 0 } else { size_of::<Filter>() };
    (size_of::<Splat>() + filter) as u64 / 4
}
