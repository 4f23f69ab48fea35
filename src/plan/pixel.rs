//! The room that a pixel takes.

use super::{ColorNeed, SceneNeeds, Winner};
use crate::scene::{MAPS, Map};

/// Where a pixel's values lie, in the sums (by channel) and in the image (by word). What is not needed takes no room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelLayout {
    /// Sums of a pixel: an even number, for accumulators that keep them in pairs. The weight's is channel 0.
    pub channels: u32,
    /// The first of the normal's three channels.
    pub normal_channel: u32,
    /// The depth's channel.
    pub depth_channel: u32,
    /// The channel of the weights of depths, where they are others than those of all else.
    pub middles_channel: u32,
    /// The fragment count's channel.
    pub count_channel: u32,
    /// The channel of what is held back, where that is summed ([`oit`](crate::passes::oit)).
    pub held_back_channel: u32,
    /// The first of the five channels of places in a texture.
    pub place_channel: u32,
    /// Words of a pixel in the image; the colour's four come first.
    pub image_words: u32,
    /// The first word of each map in the image, in the order of [`MAPS`].
    pub map_words: [u32; MAPS.len()],
}

/// The first colour channel: next to the weight's, so that the two make a pair.
pub const COLOR_CHANNEL: u32 = 1;

/// Words of a pixel's colour in the image.
const COLOR_WORDS: u32 = 4;

impl PixelLayout {
    /// The layout for `needs`.
    pub fn of(needs: &SceneNeeds) -> Self {
        let channels = |needed: bool, count: u32| if needed { count } else { 0 };
        // The normal's x and y are a pair, and pairs start at even channels.
        let normal_channel = (COLOR_CHANNEL + color_channels(needs)).next_multiple_of(2);
        let depth_channel = normal_channel + channels(needs.normal, 3);
        let middles_channel = depth_channel + channels(needs.sums_depth(), 1);
        let count_channel = middles_channel + channels(needs.compares_depth(), 1);
        let held_back_channel = count_channel + channels(needs.maps.has(Map::Count), 1);
        let place_channel = (held_back_channel + channels(needs.oit.is_some(), 1)).next_multiple_of(2);
        let mut image_words = COLOR_WORDS;
        let map_words = MAPS.each_ref().map(|row| {
            let first = image_words;
            image_words += channels(needs.maps.has(row.map) && row.image_word.is_some(), row.map.width() as u32);
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

    /// u32 words of a pixel's sums in storage, or of its nearest colour; the rasteriser's are in textures.
    pub fn sum_words(&self, needs: &SceneNeeds) -> u32 {
        match needs.winner {
            _ if needs.raster.is_some() || needs.lists.is_some() => 0,
            None => self.channels * needs.accumulator.row().words,
            Some(Winner::Once) => 2,
            Some(Winner::Second) => 1,
            Some(Winner::Depth | Winner::Rasterised) => 0,
        }
    }

    /// Blended targets of four channels that a pixel's sums need.
    pub fn targets(&self) -> u32 {
        self.channels.div_ceil(4)
    }
}

/// Colour sums of a pixel.
pub fn color_channels(needs: &SceneNeeds) -> u32 {
    match needs.color {
        ColorNeed::Constant => 0,
        _ => 3 + u32::from(needs.alpha),
    }
}
