//! The room that a fragment takes in its pixel's list.

use super::{EpsilonForm, Lists, SceneNeeds, color_channels};

/// Where a fragment's values lie in its record, by word, beside its depth, by which lists are sorted. The weight comes first; what is
/// not needed takes no room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FragmentLayout {
    /// Words of a record: whole rows of four.
    pub words: u32,
    /// The place of its surfel, where those of one depth are told apart by it.
    pub rank: u32,
    /// The first of its colour's.
    pub color: u32,
    /// How many these are.
    pub colors: u32,
    /// The first of its normal's three.
    pub normal: u32,
    /// Its surfel's radius, by which surfaces are parted.
    pub radius: u32,
    /// Whether it has that.
    pub has_radius: bool,
}

impl FragmentLayout {
    /// The layout for `needs`.
    pub fn of(needs: &SceneNeeds) -> Self {
        let (rank, colors) = (1, color_channels(needs));
        let color = rank + u32::from(needs.lists == Some(Lists::Sorted));
        let normal = color + colors;
        let radius = normal + if needs.normal { 3 } else { 0 };
        let has_radius = needs.lists == Some(Lists::Layers) && needs.epsilon == EpsilonForm::Radius;
        let words = (radius + u32::from(has_radius)).next_multiple_of(4);
        Self { words, rank, color, colors, normal, radius, has_radius }
    }
}

/// Words by which a fragment is sorted: its depth, and where its record is.
pub const KEY_WORDS: u64 = 2;
