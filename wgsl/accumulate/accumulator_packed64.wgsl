// Two neighbouring sums in the halves of one u64: half the atomic operations of
// accumulator_fixed32, with the same terms and the same overflow. Needs 64-bit atomics. Error
// bound: src/passes/accumulate.rs.
// #import layout::{WEIGHT_CHANNEL}

override CHANNELS: u32;
override FRACTION_BITS: u32;

// The first u64 counts the fragments that made a sum wrap; the sums follow.
@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u64>>;
const HEAD: u32 = 1u;

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

fn term(weight: Term, value: f32) -> Term {
    return u32(round(f32(weight) * clamp(value, 0.0, 1.0)));
}

fn add_halves(pair: u32, low: Term, high: Term) {
    let before = atomicAdd(&sums[pair], (u64(high) << 32u) | u64(low));
    let before_low = u32(before & 0xfffffffflu);
    let before_high = u32(before >> 32u);
    // A low half that wraps carries into the high half, which is as wrong as a high half that
    // wraps.
    wrapped |= before_low + low < before_low || before_high + high < before_high;
}

// Counts a fragment that made a sum wrap, after all its terms were added.
fn settle(pixel: u32) {
    if (wrapped) {
        atomicAdd(&sums[0], 1lu);
        wrapped = false;
    }
}

fn add(pixel: u32, channel: u32, value: Term) {
    let odd = (channel & 1u) == 1u;
    add_halves(HEAD + (pixel * CHANNELS + channel) / 2u, select(value, 0u, odd), select(0u, value, odd));
}

fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add_halves(HEAD + (pixel * CHANNELS + channel) / 2u, first, second);
}

fn show(pixel: u32) {}

fn sum_at(pixel: u32, channel: u32) -> f32 {
    let pair = atomicLoad(&sums[HEAD + (pixel * CHANNELS + channel) / 2u]);
    return f32(select(u32(pair & 0xfffffffflu), u32(pair >> 32u), (channel & 1u) == 1u));
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / one();
}
