//! Values of pixels as bytes: only blocks with values, of a block only the samples with values, and
//! of each number only the bytes that the largest one needs.
//!
//! ```text
//! u32      number of blocks
//! u8       channels, the numbers of a sample
//! u8 [c]   width of the numbers of each channel, bytes
//! u32 [b]  numbers of the blocks
//! u64 [b]  a bit for each of their samples
//! numbers  sample by sample, channel by channel
//! ```
//!
//! All integers are little-endian.

use super::blocks::{Blocks, marked, mask};

/// A number of a sample.
pub trait Number: bytemuck::Pod + Default + PartialEq + Send + Sync {
    fn long(self) -> u64;
    fn of(long: u64) -> Self;
}

impl Number for u32 {
    fn long(self) -> u64 {
        self.into()
    }

    fn of(long: u64) -> Self {
        long as Self
    }
}

impl Number for u64 {
    fn long(self) -> u64 {
        self
    }

    fn of(long: u64) -> Self {
        long
    }
}

/// Samples with values, in the order in which they are packed.
pub struct Packed {
    /// Numbers of the blocks, and the bits of their samples.
    blocks: Vec<(u32, u64)>,
    /// Width of each channel, bytes.
    widths: Vec<u8>,
    numbers: Vec<u8>,
}

/// Why bytes are no packed values. They come from another process of the same program.
const DAMAGED: &str = "a process sent values of pixels that are damaged";

impl Packed {
    /// Packs the values of `blocks` among `all`, `channels` for each sample. Samples of zeros are
    /// left out.
    pub fn of<T: Number>(layout: Blocks, blocks: &[u32], all: &[T], channels: usize) -> Self {
        let of_sample = |sample: usize| &all[sample * channels..(sample + 1) * channels];
        let has = |sample: usize| of_sample(sample).iter().any(|number| *number != T::default());
        let masks = blocks.iter().map(|block| (*block, mask(layout.samples(*block), has)));
        Self::of_samples(layout, masks.filter(|(_, mask)| *mask != 0).collect(), all, channels)
    }

    /// Packs the values of the samples that these bits of blocks mark.
    pub fn of_samples<T: Number>(layout: Blocks, blocks: Vec<(u32, u64)>, all: &[T], channels: usize) -> Self {
        let of_sample = |sample: usize| &all[sample * channels..(sample + 1) * channels];
        let count: usize = blocks.iter().map(|(_, mask)| mask.count_ones() as usize).sum();
        let mut values = Vec::with_capacity(count * channels);
        for (block, mask) in &blocks {
            marked(layout.samples(*block), *mask).for_each(|sample| values.extend_from_slice(of_sample(sample)));
        }
        let mut largest = vec![0u64; channels];
        for sample in values.chunks_exact(channels.max(1)) {
            largest.iter_mut().zip(sample).for_each(|(largest, number)| *largest |= number.long());
        }
        let widths: Vec<u8> = largest.iter().map(|bits| (64 - bits.leading_zeros()).div_ceil(8) as u8).collect();
        let size = count * widths.iter().map(|width| usize::from(*width)).sum::<usize>();
        // Each number is written whole, and the next one overwrites the bytes above its width.
        let mut numbers = vec![0; size + 8];
        let mut at = 0;
        for (number, width) in values.iter().zip(widths.iter().cycle()) {
            numbers[at..at + 8].copy_from_slice(&number.long().to_le_bytes());
            at += usize::from(*width);
        }
        numbers.truncate(size);
        Self { blocks, widths, numbers }
    }

    /// The bytes of the values.
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(5 + self.widths.len() + 12 * self.blocks.len() + self.numbers.len());
        bytes.extend((self.blocks.len() as u32).to_le_bytes());
        bytes.push(self.widths.len() as u8);
        bytes.extend(&self.widths);
        self.blocks.iter().for_each(|(block, _)| bytes.extend(block.to_le_bytes()));
        self.blocks.iter().for_each(|(_, mask)| bytes.extend(mask.to_le_bytes()));
        bytes.extend(&self.numbers);
        bytes
    }

    /// Reads the bytes of values.
    ///
    /// # Errors
    /// A sentence if they are not.
    pub fn read(bytes: &[u8]) -> Result<Self, &'static str> {
        let mut rest = bytes;
        let mut take = |length: usize| {
            let (taken, after) = rest.split_at_checked(length).ok_or(DAMAGED)?;
            rest = after;
            Ok::<_, &'static str>(taken)
        };
        let count = u32::from_le_bytes(take(4)?.try_into().map_err(|_| DAMAGED)?) as usize;
        let channels = usize::from(take(1)?[0]);
        let widths = take(channels)?.to_vec();
        let numbers = take(4 * count)?.chunks_exact(4).map(|word| word.try_into().map(u32::from_le_bytes));
        let numbers: Vec<u32> = numbers.collect::<Result<_, _>>().map_err(|_| DAMAGED)?;
        let masks = take(8 * count)?.chunks_exact(8).map(|word| word.try_into().map(u64::from_le_bytes));
        let masks: Vec<u64> = masks.collect::<Result<_, _>>().map_err(|_| DAMAGED)?;
        let blocks: Vec<(u32, u64)> = numbers.into_iter().zip(masks).collect();
        let packed = Self { blocks, widths, numbers: rest.to_vec() };
        let each: usize = packed.widths.iter().map(|width| usize::from(*width)).sum();
        let fits = packed.widths.iter().all(|width| *width <= 8) && packed.numbers.len() == packed.samples() * each;
        if fits { Ok(packed) } else { Err(DAMAGED) }
    }

    /// Number of samples with values.
    pub fn samples(&self) -> usize {
        self.blocks.iter().map(|(_, mask)| mask.count_ones() as usize).sum()
    }

    /// The samples with values, in order.
    pub fn places(&self, layout: Blocks) -> impl Iterator<Item = usize> {
        self.blocks.iter().flat_map(move |(block, mask)| marked(layout.samples(*block), *mask))
    }

    /// The numbers of the blocks with values, and the bits of their samples.
    pub fn blocks(&self) -> &[(u32, u64)] {
        &self.blocks
    }

    /// Adds the values to `all` by `reduce`.
    ///
    /// # Errors
    /// A sentence if `all` has other samples or channels.
    pub fn reduce<T: Number>(
        &self,
        layout: Blocks,
        (all, channels): (&mut [T], usize),
        reduce: fn(T, T) -> T,
    ) -> Result<(), &'static str> {
        if self.widths.len() != channels {
            return if self.blocks.is_empty() { Ok(()) } else { Err(DAMAGED) };
        }
        // Each number is read with the bytes of the next ones, which its width masks.
        let mut bytes = &self.numbers[..];
        let masks: Vec<(usize, u64)> = self.widths.iter().map(|width| (usize::from(*width), low(*width))).collect();
        for (block, mask) in &self.blocks {
            for sample in marked(layout.samples(*block), *mask) {
                let own = all.get_mut(sample * channels..(sample + 1) * channels).ok_or(DAMAGED)?;
                for (own, (width, mask)) in own.iter_mut().zip(&masks) {
                    let number = bytes.first_chunk().map_or_else(|| last(bytes), |eight| u64::from_le_bytes(*eight));
                    *own = reduce(*own, T::of(number & mask));
                    bytes = &bytes[*width..];
                }
            }
        }
        Ok(())
    }
}

/// The bits of the lowest `width` bytes.
fn low(width: u8) -> u64 {
    u64::MAX.checked_shr(64 - 8 * u32::from(width)).unwrap_or(0)
}

/// The number of fewer than eight bytes.
fn last(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::random::Random;
    use crate::render::exchange::Rows;
    use crate::scene::Samples;

    #[test]
    fn values_arrive_as_they_were_sent_and_damage_is_noticed() {
        let (width, channels) = (150, 3);
        let layout = Blocks::new(width, Samples::ONE, 64, 2);
        let rows = Rows { render: 0, first: 0, rows: 5, width };
        let own: Vec<u32> = layout.of(&rows).filter(|(_, owner)| *owner == 1).map(|(block, _)| block).collect();
        let mut random = Random::stream(4, 0);
        let mut all = vec![0u64; 5 * 150 * channels];
        for (k, value) in all.iter_mut().enumerate() {
            let sparse = random.number() < 0.3;
            *value = if sparse { (random.number() * 2f64.powi(8 * (k % channels) as i32 + 6)) as u64 } else { 0 };
        }
        let packed = Packed::of(layout, &own, &all, channels);
        let bytes = packed.bytes();
        assert!(bytes.len() < 8 * all.len() / 4, "{}", bytes.len());
        let mut arrived = vec![1u64; all.len()];
        Packed::read(&bytes).unwrap().reduce(layout, (&mut arrived, channels), u64::wrapping_add).unwrap();
        for sample in 0..5 * 150 {
            let is_own = own.iter().any(|block| layout.samples(*block).contains(&sample));
            for number in sample * channels..(sample + 1) * channels {
                assert_eq!(arrived[number] - 1, if is_own { all[number] } else { 0 });
            }
        }
        for cut in [0, 3, 5, 20, bytes.len() - 1] {
            assert!(Packed::read(&bytes[..cut]).is_err(), "{cut}");
        }
        let mut wrong = bytes.clone();
        wrong[5] = 9;
        assert!(Packed::read(&wrong).is_err());
        let mut small = vec![0; 3];
        assert!(packed.reduce(layout, (&mut small, channels), u64::max).is_err());
    }
}
