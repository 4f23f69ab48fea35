//! The room that a surfel and its splat take, beside the surfel's shape.

use super::{ColorNeed, SceneNeeds};
use crate::gpu::layout::{Filter, Splat};
use crate::scene::LowPass;
use crate::scene::harmonics::terms_of;

/// Where a surfel's attributes lie in its record, by word. What is not needed takes no room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfelLayout {
    /// Words of a record; the colour comes first, a place in a texture after it.
    pub words: u32,
    /// How many surfels it stands for.
    pub copies: u32,
    /// The first of the three trailing parts of its centre.
    pub low: u32,
    /// The first of the six words of the lines at which it ends.
    pub clip: u32,
    /// The first of the three words of its cap.
    pub cap: u32,
    /// The first of the three words of its own normal.
    pub normal: u32,
    /// Its place in a tree.
    pub number: u32,
    /// How much of it there is: the last word, which surfels of a tree do without.
    pub fade: u32,
}

impl SurfelLayout {
    /// The layout for `needs`.
    pub fn of(needs: &SceneNeeds) -> Self {
        let copies = match needs.color {
            ColorNeed::Constant => 0,
            ColorNeed::Srgb8 => 1,
            ColorNeed::Linear => 4,
            ColorNeed::Harmonics(degree) => 4 + 3 * terms_of(degree) as u32,
            // A colour, a place and two slopes.
            ColorNeed::Textured => 16,
        };
        let low = copies + u32::from(needs.copies);
        let clip = low + if needs.doubled { 3 } else { 0 };
        let cap = clip + if needs.clips { 6 } else { 0 };
        let normal = cap + if needs.curved { 3 } else { 0 };
        let number = normal + if needs.own_normals { 3 } else { 0 };
        let fade = number + u32::from(needs.numbers_surfels());
        Self { words: fade + u32::from(needs.fades && !needs.levels), copies, low, clip, cap, normal, number, fade }
    }
}

/// Words of a splat's record, of which those of its low-pass, its lines, its cap and its fade come last.
pub fn splat_words(needs: &SceneNeeds) -> u64 {
    let filter = if needs.low_pass == LowPass::None { 0 } else { size_of::<Filter>() };
    let clip = if needs.clips { CLIP_WORDS } else { 0 };
    let cap = if needs.curved { CAP_WORDS } else { 0 };
    let fade = if needs.fades { FADE_WORDS } else { 0 };
    (size_of::<Splat>() + filter) as u64 / 4 + clip + cap + fade
}

/// Words of a splat's lines: whole rows of four, as all of its record.
const CLIP_WORDS: u64 = 8;

/// Words of a splat's cap.
const CAP_WORDS: u64 = 8;

/// Words of a splat's fade: a row, of which two are used.
const FADE_WORDS: u64 = 4;
