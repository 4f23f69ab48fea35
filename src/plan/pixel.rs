//! The layout of a pixel's sums and of its image record.

use super::{ColorNeed, SceneNeeds, Surface, Winner};
use crate::scene::{MAPS, Map};

/// Offsets of a pixel's values: in the sums by channel, in the image by u32 word. Values that are
/// not needed take no space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelLayout {
    /// Number of sums per pixel, even for accumulators that store pairs. Channel 0 is the weight.
    pub channels: u32,
    /// The first of the normal's three channels.
    pub normal_channel: u32,
    /// The depth's channel.
    pub depth_channel: u32,
    /// The channel of the weights for depths, if depths have weights of their own.
    pub middles_channel: u32,
    /// The fragment count's channel.
    pub count_channel: u32,
    /// The channel of the optical depth, where all fragments are summed
    /// ([`oit`](crate::passes::oit)).
    pub held_back_channel: u32,
    /// The first of the five channels of texture places.
    pub place_channel: u32,
    /// u32 words of a pixel in the image; its colour is in the first four.
    pub image_words: u32,
    /// The first word of each map in the image, in the order of [`MAPS`], or [`NO_MAP`].
    pub map_words: [u32; MAPS.len()],
}

/// The first colour channel, next to the weight's, so that the two form a pair.
pub const COLOR_CHANNEL: u32 = 1;

/// u32 words of a pixel's colour in the image.
const COLOR_WORDS: u32 = 4;

/// The word offset of a map that is not asked for (`maps.wgsl`).
pub const NO_MAP: u32 = u32::MAX;

impl PixelLayout {
    /// The layout for `needs`.
    pub fn of(needs: &SceneNeeds) -> Self {
        let channels = |needed: bool, count: u32| if needed { count } else { 0 };
        // The normal's x and y form a pair, and pairs start at even channels.
        let normal_channel = (COLOR_CHANNEL + color_channels(needs)).next_multiple_of(2);
        let depth_channel = normal_channel + channels(needs.normal, 3);
        let middles_channel = depth_channel + channels(needs.sums_depth(), 1);
        let count_channel = middles_channel + channels(needs.compares_depth(), 1);
        let held_back_channel = count_channel + channels(needs.maps.has(Map::Count), 1);
        let place_channel = (held_back_channel + channels(needs.surface.oit().is_some(), 1)).next_multiple_of(2);
        let mut image_words = COLOR_WORDS;
        let map_words = MAPS.each_ref().map(|row| {
            if !needs.maps.has(row.map) || row.image_word.is_none() {
                return NO_MAP;
            }
            let first = image_words;
            image_words += row.map.width() as u32;
            first
        });
        Self {
            channels: (place_channel + channels(needs.color == ColorNeed::Textured, 5)).next_multiple_of(2),
            normal_channel,
            depth_channel,
            middles_channel,
            count_channel,
            held_back_channel,
            place_channel,
            image_words,
            map_words,
        }
    }

    /// u32 words per pixel of sums in storage, or of the nearest colour; 0 if sums are in the
    /// rasteriser's textures or in lists.
    pub fn sum_words(&self, needs: &SceneNeeds) -> u32 {
        match needs.surface {
            Surface::Blended { .. } | Surface::OrderFree(_) => self.channels * needs.accumulator.row().words,
            Surface::Nearest(Winner::Once) => 2,
            Surface::Nearest(Winner::Second) => 1,
            Surface::Nearest(Winner::Depth) => 0,
            Surface::Layers { .. } | Surface::Sorted { .. } | Surface::Raster { .. } => 0,
        }
    }

    /// Number of blended four-channel targets for a pixel's sums.
    pub fn targets(&self) -> u32 {
        self.channels.div_ceil(4)
    }
}

/// Number of colour sums per pixel.
pub fn color_channels(needs: &SceneNeeds) -> u32 {
    match needs.color {
        ColorNeed::Constant => 0,
        _ => 3 + u32::from(needs.alpha),
    }
}
