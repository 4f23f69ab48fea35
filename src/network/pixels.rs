//! Some pixels of a frame as bytes.

use super::blocks::marked;
use crate::frame::Frame;
use crate::scene::Map;

/// Words of a pixel: its colour, and its values of each map.
fn words(frame: &Frame) -> usize {
    4 + frame.maps().iter().map(Map::width).sum::<usize>()
}

/// The pixels of `frame` that are set in `covered`: their numbers, then their values.
pub fn bytes(frame: &Frame, covered: &[u64]) -> Vec<u8> {
    let count = covered.iter().map(|word| word.count_ones() as usize).sum();
    let mut pixels = Vec::with_capacity(count);
    for (word, mask) in covered.iter().enumerate() {
        pixels.extend(marked(64 * word..64 * word + 64, *mask));
    }
    let mut values = Vec::with_capacity(1 + pixels.len() * (1 + words(frame)));
    values.push(pixels.len() as u32);
    values.extend(pixels.iter().map(|pixel| *pixel as u32));
    values.extend(pixels.iter().flat_map(|pixel| frame.color[*pixel].map(f32::to_bits)));
    for map in frame.maps().iter() {
        let (all, width) = (frame.map(map).unwrap_or_default(), map.width());
        let of_pixel = |pixel: &usize| all[pixel * width..(pixel + 1) * width].iter().map(|value| value.to_bits());
        values.extend(pixels.iter().flat_map(of_pixel));
    }
    bytemuck::cast_slice(&values).to_vec()
}

/// Puts the pixels of [`bytes`] into a frame; None if they are not those of such a frame.
pub fn put(frame: &mut Frame, bytes: &[u8]) -> Option<()> {
    let values = bytemuck::pod_collect_to_vec::<u8, u32>(bytes);
    let (count, rest) = values.split_first()?;
    let (pixels, mut rest) = rest.split_at_checked(*count as usize)?;
    if rest.len() != pixels.len() * words(frame) {
        return None;
    }
    let mut take = |width: usize| {
        let (taken, after) = rest.split_at(pixels.len() * width);
        rest = after;
        taken
    };
    for (pixel, color) in pixels.iter().zip(take(4).chunks_exact(4)) {
        *frame.color.get_mut(*pixel as usize)? = [0, 1, 2, 3].map(|k| f32::from_bits(color[k]));
    }
    for map in frame.maps().iter() {
        let width = map.width();
        let all = frame.map_mut(map)?;
        for (pixel, values) in pixels.iter().zip(take(width).chunks_exact(width)) {
            let first = *pixel as usize * width;
            let own = all.get_mut(first..first + width)?;
            own.iter_mut().zip(values).for_each(|(own, value)| *own = f32::from_bits(*value));
        }
    }
    Some(())
}
