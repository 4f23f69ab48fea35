//! The records of a surfel's attributes and of its splat.

use super::{ColorNeed, SceneNeeds};
use crate::gpu::layout::{Filter, Splat};
use crate::scene::LowPass;
use crate::scene::harmonics::terms_of;

/// Word offsets of a surfel's attributes in its record. Attributes that are not needed take no
/// space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfelLayout {
    /// u32 words of a record. The colour is at word 0, followed by the place in a texture, if any.
    pub words: u32,
    /// The number of identical surfels that the surfel stands for.
    pub copies: u32,
    /// The first of the three low parts of the centre, the digits beyond f32.
    pub low: u32,
    /// The first of the six words of the clip lines.
    pub clip: u32,
    /// The first of the three words of the curvature (cap).
    pub cap: u32,
    /// The third half-axis.
    pub third: u32,
    /// The first of the three words of the surfel's own normal.
    pub normal: u32,
    /// The surfel's place in the octree.
    pub number: u32,
    /// The range of fading cuts that contain the surfel. This is the last word; surfels of an
    /// octree do not have it.
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
            // A colour, texture coordinates, and their two derivatives.
            ColorNeed::Textured => 16,
        };
        let low = copies + u32::from(needs.surface.copies());
        let clip = low + if needs.doubled { 3 } else { 0 };
        let cap = clip + if needs.clips { 6 } else { 0 };
        let third = cap + if needs.curved { 3 } else { 0 };
        let normal = third + u32::from(needs.solid);
        let number = normal + if needs.own_normals { 3 } else { 0 };
        let fade = number + u32::from(needs.numbers_surfels());
        Self {
            words: fade + u32::from(needs.fades && !needs.levels),
            copies,
            low,
            clip,
            cap,
            third,
            normal,
            number,
            fade,
        }
    }
}

/// u32 words of a splat's record. The optional parts come last: low-pass, clip lines, cap and fade.
pub fn splat_words(needs: &SceneNeeds) -> u64 {
    let filter = if needs.low_pass == LowPass::None { 0 } else { size_of::<Filter>() };
    let clip = if needs.clips { CLIP_WORDS } else { 0 };
    let cap = if needs.curved { CAP_WORDS } else { 0 };
    let fade = if needs.fades { FADE_WORDS } else { 0 };
    (size_of::<Splat>() + filter) as u64 / 4 + clip + cap + fade
}

/// u32 words of a splat's clip lines: a multiple of four, like every part of the record.
const CLIP_WORDS: u64 = 8;

/// u32 words of a splat's cap.
const CAP_WORDS: u64 = 8;

/// u32 words of a splat's fade: a row of four, of which two are used.
const FADE_WORDS: u64 = 4;
