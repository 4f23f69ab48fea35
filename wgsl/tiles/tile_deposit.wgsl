// Stored sums of two words each, low and high. Same interface as tile_deposit_pairs.wgsl.
// #import *::{CHANNELS, sums}
// #import staged_sums|tile_sums::{sum_words}

fn deposit_one(word: u32, value: vec2<u32>) {
    let sum = sum_words(vec2<u32>(sums[word], sums[word + 1u]), value);
    sums[word] = sum.x;
    sums[word + 1u] = sum.y;
}

fn deposit_sums(pixel: u32, channel: u32, first: vec2<u32>, second: vec2<u32>) {
    let word = 2u * (pixel * CHANNELS + channel);
    deposit_one(word, first);
    deposit_one(word + 2u, second);
}
