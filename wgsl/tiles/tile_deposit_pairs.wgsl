// Stored sums in the layout of accumulator_fixed_pairs.wgsl: one u64 has the low words of two sums,
// the next one counts the carries of each. The second sum also includes the carries of the first.
// #import *::{CHANNELS, sums}
// #import staged_sums|tile_sums::{sum_words}

fn deposit_sums(pixel: u32, channel: u32, first: vec2<u32>, second: vec2<u32>) {
    let word = 2u * (pixel * CHANNELS + channel);
    let carries = word + 2u;
    let low = sum_words(vec2<u32>(sums[word], sums[carries]), first);
    let carried = low.y - sums[carries];
    let high = sum_words(sum_words(vec2<u32>(sums[word + 1u], sums[carries + 1u]), second), vec2<u32>(carried, 0u));
    sums[word] = low.x;
    sums[carries] = low.y;
    sums[word + 1u] = high.x;
    sums[carries + 1u] = high.y;
}
