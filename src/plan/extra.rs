//! Per-pixel buffers that only some renders have: one row each.

use super::steps::Clear;
use super::{Oit, Plan, SceneNeeds};

/// A per-pixel buffer that only some renders have.
pub struct Extra {
    /// Its name in WGSL.
    pub name: &'static str,
    /// Its name in errors and tools.
    pub label: &'static str,
    /// Its u32 words per pixel; 0 if a render does not have it.
    pub words: fn(&SceneNeeds) -> u32,
    /// Whether the visibility pass adds to it, so that it starts at 0.
    pub summed: bool,
}

/// The number of depth intervals for which veils sum optical depths
/// ([`veils`](crate::passes::veils)).
pub const VEILS: u32 = 16;

/// All buffers that only some renders have.
pub const EXTRA: [Extra; 4] = [
    Extra {
        name: "veils",
        label: "veils",
        // The count and the optical depth of each interval.
        words: |needs| if needs.surface.veils() { 2 * VEILS } else { 0 },
        summed: true,
    },
    Extra {
        name: "moments",
        label: "moments",
        // Two for each of five moments.
        words: |needs| if needs.surface.oit() == Some(Oit::Moments) { 10 } else { 0 },
        summed: true,
    },
    Extra {
        name: "peeled",
        label: "peeled layers",
        words: |needs| if needs.surface.peels().is_some() { 8 } else { 0 },
        summed: false,
    },
    Extra {
        name: "individuals",
        label: "pixels of individuals",
        words: |needs| match needs.surface.separate() {
            false => 0,
            true if needs.maps.is_empty() && needs.mesh.is_none() => 8,
            true => 16,
        },
        summed: false,
    },
];

/// Words per pixel of the shaded triangles.
pub const TRIANGLE_PIXEL_WORDS: u32 = 8;

/// The words per pixel of the buffer `name`; 0 if a render with `needs` does not have it.
pub fn words_of(name: &str, needs: &SceneNeeds) -> u32 {
    EXTRA.iter().find(|extra| extra.name == name).map_or(0, |extra| (extra.words)(needs))
}

/// The clear of the buffer `name` in a band; `None` if the render does not have it.
pub fn clear(name: &'static str, plan: &Plan, band: usize) -> Option<Clear> {
    let words = plan.bands[band].pixels * u64::from(words_of(name, &plan.needs));
    (words > 0).then(|| Clear::of(name, 0, words))
}

/// The most words per pixel in any of these buffers and in that of the shaded triangles.
pub(super) fn most_words(needs: &SceneNeeds) -> u32 {
    // Triangles also take four words per tile. A tile has 64 pixels, or fewer at the image's edges,
    // so that is at most one more word per pixel unless the image is tiny.
    let triangles = if needs.mesh.is_some() { TRIANGLE_PIXEL_WORDS + 1 } else { 0 };
    EXTRA.iter().map(|extra| (extra.words)(needs)).max().unwrap_or(0).max(triangles)
}
