// Sums in fixed point, two words each (low, high), of terms that may exceed one word: those of
// terms_wide.wgsl, and those of surfels that stand for several copies (copies.wgsl). Most terms
// take two atomic additions; in accumulator_fixed.wgsl they take one.
// Error bound: src/passes/accumulate.rs.
// #import *::{Term}
// #import copies::{multiplied}
// #import layout::{WEIGHT_CHANNEL}
// #import terms|terms_wide::{ONE, term_words}

override CHANNELS: u32;

@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u32>>;

fn add(pixel: u32, channel: u32, value: Term) {
    let word = 2u * (pixel * CHANNELS + channel);
    let term = multiplied(term_words(value));
    let before = atomicAdd(&sums[word], term.x);
    let high = term.y + select(0u, 1u, before + term.x < before);
    if (high > 0u) {
        atomicAdd(&sums[word + 1u], high);
    }
}

// Adds to two neighbouring sums, of which the first has an even channel.
fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

fn settle(pixel: u32) {}

fn show(pixel: u32) {}

// Reads a sum, in units of the terms. The unit cancels in ratios of two sums.
fn sum_at(pixel: u32, channel: u32) -> f32 {
    let word = 2u * (pixel * CHANNELS + channel);
    return f32(atomicLoad(&sums[word + 1u])) * 4294967296.0 + f32(atomicLoad(&sums[word]));
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / ONE;
}
