// Sums in fixed point of one u64: 40 fractional bits a term, room for 2^24 full weights. Needs 64-bit atomics.
// Error bound: src/passes/accumulate.rs.

override CHANNELS: u32;

@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u64>>;

alias Term = u64;
const COUNT_ONE: Term = 1lu;

// The units of a weight of 1: 2^40.
const ONE: f32 = 1099511627776.0;

// Scaling by a power of two is exact, and what of an f32 of at least 2^-10 lies below 2^-40 is less than its rounding.
fn quantise(weight: f32) -> Term {
    return u64(weight * ONE);
}

fn term(weight: Term, value: f32) -> Term {
    return u64(f32(weight) * clamp(value, 0.0, 1.0));
}

fn add(pixel: u32, channel: u32, value: Term) {
    atomicAdd(&sums[pixel * CHANNELS + channel], value);
}

fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

fn settle(pixel: u32) {}

// Rounded as accumulator_fixed_wide.wgsl does, which has the same sums in two words.
fn show(pixel: u32) {}

fn sum_at(pixel: u32, channel: u32) -> f32 {
    let sum = atomicLoad(&sums[pixel * CHANNELS + channel]);
    return f32(u32(sum >> 32u)) * 4294967296.0 + f32(u32(sum & 0xfffffffflu));
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / ONE;
}
