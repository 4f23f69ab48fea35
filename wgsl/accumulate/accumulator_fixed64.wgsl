// Sums of the terms of terms_wide.wgsl in fixed point, one u64 each. A sum can hold 2^24 full
// weights, or one full weight of every surfel. Needs 64-bit atomics.
// Error bound: src/passes/accumulate.rs.
// #import *::{Term}
// #import layout::{WEIGHT_CHANNEL}
// #import terms|terms_wide::{ONE}

override CHANNELS: u32;

@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u64>>;

// Truncates a term to whole units, as the two words of accumulator_fixed_wide.wgsl do.
fn add(pixel: u32, channel: u32, value: Term) {
    atomicAdd(&sums[pixel * CHANNELS + channel], u64(value));
}

fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

fn settle(pixel: u32) {}

fn show(pixel: u32) {}

// Rounds like accumulator_fixed_wide.wgsl, which stores the same sums in two words.
fn sum_at(pixel: u32, channel: u32) -> f32 {
    let sum = atomicLoad(&sums[pixel * CHANNELS + channel]);
    return f32(u32(sum >> 32u)) * 4294967296.0 + f32(u32(sum & 0xfffffffflu));
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / ONE;
}
