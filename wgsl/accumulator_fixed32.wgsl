// Sums in fixed point of one word. FRACTION_BITS follow from the scene, at least 24: sums of more than 2^(32 - bits)
// full weights wrap, which is noticed, and the frame is rendered again with accumulator_fixed.
// Error bound: src/passes/accumulate.rs.

override CHANNELS: u32;
override FRACTION_BITS: u32;

// Two words come first: how many fragments made a sum wrap, and none.
@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u32>>;
const HEAD: u32 = 2u;

// The fragment in work did.
var<private> wrapped: bool;

alias Term = u32;
const COUNT_ONE: Term = 1u;

fn one() -> f32 {
    return f32(1u << FRACTION_BITS);
}

fn quantise(weight: f32) -> Term {
    return u32(round(weight * one()));
}

// The weight of its term.
fn part_of(weight: Term) -> f32 {
    return f32(weight) / one();
}

// The weight came from an f32, so it has at most 24 significant bits and is exact as f32.
fn term(weight: Term, value: f32) -> Term {
    return u32(round(f32(weight) * clamp(value, 0.0, 1.0)));
}

fn add(pixel: u32, channel: u32, value: Term) {
    let before = atomicAdd(&sums[HEAD + pixel * CHANNELS + channel], value);
    wrapped |= before + value < before;
}

// After a fragment's terms.
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
