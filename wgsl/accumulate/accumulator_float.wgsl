// Sums in f32 by atomic add, like those of a hardware blender with float targets. The rounding
// depends on the order, so two runs may differ. Needs f32 atomics.
// Error bound: src/passes/accumulate.rs.
// #import layout::{WEIGHT_CHANNEL}

override CHANNELS: u32;

@group(0) @binding(8) var<storage, read_write> sums: array<atomic<f32>>;

alias Term = f32;
const COUNT_ONE: Term = 1.0;

fn quantise(weight: f32) -> Term {
    return weight;
}

// The weight that a term stands for.
fn part_of(weight: Term) -> f32 {
    return weight;
}

fn term(weight: Term, value: f32) -> Term {
    return weight * clamp(value, 0.0, 1.0);
}

fn add(pixel: u32, channel: u32, value: Term) {
    atomicAdd(&sums[pixel * CHANNELS + channel], value);
}

fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

fn settle(pixel: u32) {}

fn show(pixel: u32) {}

fn sum_at(pixel: u32, channel: u32) -> f32 {
    return atomicLoad(&sums[pixel * CHANNELS + channel]);
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL);
}
