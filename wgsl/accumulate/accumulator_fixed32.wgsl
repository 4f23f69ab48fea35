// Sums in fixed point, one word each. FRACTION_BITS depends on the scene and is at least 24. A sum
// of 2^(32 - FRACTION_BITS) full weights wraps; this is detected, and the frame is rendered again
// with accumulator_fixed. Error bound: src/passes/accumulate.rs.
// #import layout::{WEIGHT_CHANNEL}

override CHANNELS: u32;
override FRACTION_BITS: u32;

// Word 0 counts the fragments that made a sum wrap, word 1 is unused, and the sums follow.
@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u32>>;
const HEAD: u32 = 2u;

// Whether a sum wrapped while the current fragment was added.
var<private> wrapped: bool;

alias Term = u32;
const COUNT_ONE: Term = 1u;

fn one() -> f32 {
    return f32(1u << FRACTION_BITS);
}

fn quantise(weight: f32) -> Term {
    return u32(round(weight * one()));
}

// The weight that a term stands for.
fn part_of(weight: Term) -> f32 {
    return f32(weight) / one();
}

// weight * value, for a value in [0, 1]. The weight came from an f32, so it has at most 24
// significant bits and converts back exactly.
fn term(weight: Term, value: f32) -> Term {
    return u32(round(f32(weight) * clamp(value, 0.0, 1.0)));
}

fn add(pixel: u32, channel: u32, value: Term) {
    let before = atomicAdd(&sums[HEAD + pixel * CHANNELS + channel], value);
    wrapped |= before + value < before;
}

// Counts a fragment that made a sum wrap, after all its terms were added.
fn settle(pixel: u32) {
    if (wrapped) {
        atomicAdd(&sums[0], 1u);
        wrapped = false;
    }
}

fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

fn show(pixel: u32) {}

fn sum_at(pixel: u32, channel: u32) -> f32 {
    return f32(atomicLoad(&sums[HEAD + pixel * CHANNELS + channel]));
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / one();
}
