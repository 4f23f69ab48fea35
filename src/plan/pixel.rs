//! The room that a pixel takes.

use super::{ColorNeed, SceneNeeds};

/// Where a pixel's values lie, in the sums (by channel) and in the image (by word). What is not needed takes no room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelLayout {
    /// Sums of a pixel: an even number, for accumulators that keep them in pairs. The weight's is channel 0.
    pub channels: u32,
    /// The first of the normal's three channels.
    pub normal_channel: u32,
    /// The depth's channel.
    pub depth_channel: u32,
    /// The fragment count's channel.
    pub count_channel: u32,
    /// The first of the four channels of places in a texture.
    pub place_channel: u32,
    /// Words of a pixel in the image; the colour's four come first.
    pub image_words: u32,
    /// Word of the normal map's x in the image.
    pub normal_image: u32,
    /// Word of the depth in the image.
    pub depth_image: u32,
    /// Word of the weight in the image.
    pub weight_image: u32,
    /// Word of the count in the image.
    pub count_image: u32,
}

/// The first colour channel: next to the weight's, so that the two make a pair.
pub const COLOR_CHANNEL: u32 = 1;

impl PixelLayout {
    /// The layout for `needs`.
    pub fn of(needs: &SceneNeeds) -> Self {
        let channels = |needed: bool, count: u32| if needed { count } else { 0 };
        // The normal's x and y are a pair, and pairs start at even channels.
        let normal_channel = (COLOR_CHANNEL + color_channels(needs)).next_multiple_of(2);
        let depth_channel = normal_channel + channels(needs.normal, 3);
        let count_channel = depth_channel + channels(needs.depth, 1);
        let place_channel = (count_channel + channels(needs.count, 1)).next_multiple_of(2);
        let normal_image = 4;
        let depth_image = normal_image + channels(needs.normal_map, 3);
        let weight_image = depth_image + channels(needs.depth, 1);
        let count_image = weight_image + channels(needs.weight_map, 1);
        Self {
            channels: place_channel + channels(needs.color == ColorNeed::Textured, 4),
            normal_channel,
            depth_channel,
            count_channel,
            place_channel,
            image_words: count_image + channels(needs.count, 1),
            normal_image,
            depth_image,
            weight_image,
            count_image,
        }
    }

    /// u32 words of a pixel's sums in storage; the rasteriser's are in textures.
    pub fn sum_words(&self, needs: &SceneNeeds) -> u32 {
        if needs.raster.is_some() { 0 } else { self.channels * needs.accumulator.row().words }
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
