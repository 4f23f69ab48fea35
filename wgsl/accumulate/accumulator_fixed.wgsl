// Sums of the terms of terms.wgsl in fixed point. A term fills one word; a sum has two, (low,
// high), with an exact carry. Error bound: src/passes/accumulate.rs.
// All loops end, by 3 of src/gpu/loops.rs: 0x1ba1a3f356b11b29
// #import *::{Term}
// #import layout::{WEIGHT_CHANNEL}
// #import terms|terms_wide::{ONE}

override CHANNELS: u32;

@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u32>>;

// The channels whose low words wrapped while the current fragment was added, one bit each.
var<private> carries: u32;

fn add_stored(pixel: u32, channel: u32, value: Term) {
    let before = atomicAdd(&sums[2u * (pixel * CHANNELS + channel)], value);
    carries |= select(0u, 1u << channel, before + value < before);
}

// Adds the carries of a fragment. They are rare, so one loop over all channels costs less than a
// branch for each.
fn settle_stored(pixel: u32) {
    while (carries != 0u) {
        let channel = firstTrailingBit(carries);
        atomicAdd(&sums[2u * (pixel * CHANNELS + channel) + 1u], 1u);
        carries &= carries - 1u;
    }
}

// Adds to two neighbouring sums, of which the first has an even channel.
fn add_pair_stored(pixel: u32, channel: u32, first: Term, second: Term) {
    add_stored(pixel, channel, first);
    add_stored(pixel, channel + 1u, second);
}

fn deposit_one_stored(word: u32, value: vec2<u32>) {
    var high = value.y;
    if (value.x > 0u) {
        let before = atomicAdd(&sums[word], value.x);
        high += select(0u, 1u, before + value.x < before);
    }
    if (high > 0u) {
        atomicAdd(&sums[word + 1u], high);
    }
}

// Adds to two neighbouring sums, of which the first has an even channel, numbers of two words each,
// low and high.
fn deposit_stored(pixel: u32, channel: u32, first: vec2<u32>, second: vec2<u32>) {
    let word = 2u * (pixel * CHANNELS + channel);
    deposit_one_stored(word, first);
    deposit_one_stored(word + 2u, second);
}

fn show(pixel: u32) {}

// Reads a sum, in units of the terms. The unit cancels in ratios of two sums.
fn sum_at(pixel: u32, channel: u32) -> f32 {
    let word = 2u * (pixel * CHANNELS + channel);
    return f32(atomicLoad(&sums[word + 1u])) * 4294967296.0 + f32(atomicLoad(&sums[word]));
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / ONE;
}
