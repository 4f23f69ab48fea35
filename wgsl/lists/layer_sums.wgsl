// The sums of one surface of a pixel, in registers. They equal those of accumulator_fixed.wgsl to
// the bit.
// All loops end, by 1 of src/gpu/loops.rs: 0x5ddb7c4b554145a0
// #import *::{Term}
// #import layout::{WEIGHT_CHANNEL}
// #import terms|terms_wide::{ONE, term_words}

override CHANNELS: u32;

var<private> layer_low: array<u32, 12>;
var<private> layer_high: array<u32, 12>;

fn clear_sums() {
    for (var channel = 0u; channel < CHANNELS; channel++) {
        layer_low[channel] = 0u;
        layer_high[channel] = 0u;
    }
}

fn add(pixel: u32, channel: u32, value: Term) {
    let words = term_words(value);
    let sum = layer_low[channel] + words.x;
    layer_high[channel] += words.y + select(0u, 1u, sum < words.x);
    layer_low[channel] = sum;
}

fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

fn settle(pixel: u32) {}

fn sum_at(pixel: u32, channel: u32) -> f32 {
    return f32(layer_high[channel]) * 4294967296.0 + f32(layer_low[channel]);
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / ONE;
}
