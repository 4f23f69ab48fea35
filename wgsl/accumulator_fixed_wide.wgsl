// Sums in fixed point of terms that may reach into the high word, two words a sum (low, high): those of terms_wide.wgsl, and
// terms of surfels that stand for several (copies.wgsl). Most additions are two; accumulator_fixed.wgsl has one.
// Error bound: src/passes/accumulate.rs.

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

// Two sums that are neighbours; the first is an even channel.
fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

fn settle(pixel: u32) {}

fn show(pixel: u32) {}

// A sum read back, in the units of the terms; ratios of two sums have no unit.
fn sum_at(pixel: u32, channel: u32) -> f32 {
    let word = 2u * (pixel * CHANNELS + channel);
    return f32(atomicLoad(&sums[word + 1u])) * 4294967296.0 + f32(atomicLoad(&sums[word]));
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / ONE;
}
