//! Buffers that only some renders have, in u32 words per pixel.

use super::{Oit, SceneNeeds};

/// Words of the buffer `peeled` (`peeled.wgsl`): the layers composited so far.
pub const PEELED_WORDS: u32 = 8;

/// Words of the moments of transmittance: two per moment.
pub const MOMENT_WORDS: u32 = 10;

/// Words of the shaded triangles.
pub const TRIANGLE_PIXEL_WORDS: u32 = 8;

/// The number of steps of depth in which veils sum optical depths ([`veils`](crate::passes::veils)).
pub const VEILS: u32 = 16;

/// Words of veils: the count and the optical depth of each step.
pub const VEIL_WORDS: u32 = 2 * VEILS;

/// Words of the nearest surface of the separate inputs so far.
pub fn individual_words(needs: &SceneNeeds) -> u32 {
    match needs.surface.separate() {
        false => 0,
        true if needs.maps.is_empty() && needs.mesh.is_none() => 8,
        true => 16,
    }
}

/// The most words in any of these buffers.
pub(super) fn most_words(needs: &SceneNeeds) -> u32 {
    let of = |has: bool, words: u32| if has { words } else { 0 };
    let peeled = of(needs.surface.peels().is_some(), PEELED_WORDS);
    let moments = of(needs.surface.oit() == Some(Oit::Moments), MOMENT_WORDS);
    let veils = of(needs.surface.veils(), VEIL_WORDS);
    // Four words per tile of 64 pixels (fewer at the image's edges) are at most one more per pixel,
    // unless the image has only a few pixels.
    let triangles = of(needs.mesh.is_some(), TRIANGLE_PIXEL_WORDS + 1);
    peeled.max(moments).max(triangles).max(individual_words(needs)).max(veils)
}
