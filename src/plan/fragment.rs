//! The record of a fragment in its pixel's list.

use super::{EpsilonForm, Lists, SceneNeeds, color_channels};

/// Word offsets of a fragment's values in its record. The weight is word 0. The depth, by which
/// lists are sorted, is stored elsewhere ([`KEY_WORDS`]). Values that are not needed take no space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FragmentLayout {
    /// u32 words of a record: a multiple of four.
    pub words: u32,
    /// The rank of the surfel, stored if it decides between fragments at one depth.
    pub rank: u32,
    /// The first word of the colour.
    pub color: u32,
    /// Number of words of the colour.
    pub colors: u32,
    /// The first of the three words of the normal.
    pub normal: u32,
    /// The surfel's radius, by which layers are separated.
    pub radius: u32,
    /// Whether the radius is stored.
    pub has_radius: bool,
}

impl FragmentLayout {
    /// The layout for `needs`.
    pub fn of(needs: &SceneNeeds) -> Self {
        let (rank, colors) = (1, color_channels(needs));
        let color = rank + u32::from(needs.surface.lists() == Some(Lists::Sorted));
        let normal = color + colors;
        let radius = normal + if needs.normal { 3 } else { 0 };
        let has_radius = needs.surface.lists() == Some(Lists::Layers) && needs.epsilon == EpsilonForm::Radius;
        let words = (radius + u32::from(has_radius)).next_multiple_of(4);
        Self { words, rank, color, colors, normal, radius, has_radius }
    }
}

/// u32 words of a fragment's sort key: its depth and the index of its record.
pub const KEY_WORDS: u64 = 2;
