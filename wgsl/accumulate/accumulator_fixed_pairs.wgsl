// The sums of accumulator_fixed.wgsl, bit for bit, for adapters with 64-bit atomics. Two
// neighbouring sums are the halves of one u64, so that a fragment takes half as many additions. A
// low half that wraps carries into the high half. The next u64 counts the carries of both halves.
// Readers subtract the carries of the low half from the high half again.
// Error bound: src/passes/accumulate.rs.
// All loops end, by 1, 3 of src/gpu/loops.rs: 0xfc00a8777b1d06b0
// #import *::{Term}
// #import layout::{WEIGHT_CHANNEL}
// #import terms|terms_wide::{ONE}

override CHANNELS: u32;

// For each pair of a pixel's channels: a u64 of sums and a u64 of carries.
@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u64>>;

// The carries of the current fragment, three bits per pair: one bit for the carry of the low half,
// and two that count the carries of the high half. The high half may wrap twice if add_stored()
// adds the halves one after the other, the first time by a carry from the low half.
var<private> carries: u32;

fn add_halves(pixel: u32, pair: u32, low: Term, high: Term) {
    let before = atomicAdd(&sums[pixel * CHANNELS + 2u * pair], (u64(high) << 32u) | u64(low));
    let before_low = u32(before & 0xfffffffflu);
    let before_high = u32(before >> 32u);
    let from_low = select(0u, 1u, before_low + low < before_low);
    // A term is less than 2^32 - 1, so `high + from_low` does not wrap.
    let from_high = select(0u, 2u, before_high + (high + from_low) < before_high);
    carries += (from_low + from_high) << (3u * pair);
}

fn add_stored(pixel: u32, channel: u32, value: Term) {
    let odd = (channel & 1u) == 1u;
    add_halves(pixel, channel >> 1u, select(value, 0u, odd), select(0u, value, odd));
}

fn add_pair_stored(pixel: u32, channel: u32, first: Term, second: Term) {
    add_halves(pixel, channel >> 1u, first, second);
}

// Adds to two neighbouring sums, of which the first has an even channel, numbers of two words each,
// low and high. Readers subtract all carries of the low half from the high half, so the high word
// of the first number is also added there.
fn deposit_stored(pixel: u32, channel: u32, first: vec2<u32>, second: vec2<u32>) {
    let place = pixel * CHANNELS + 2u * (channel >> 1u);
    let middle = second.x + first.y;
    let before = atomicAdd(&sums[place], (u64(middle) << 32u) | u64(first.x));
    let before_low = u32(before & 0xfffffffflu);
    let before_high = u32(before >> 32u);
    let from_low = select(0u, 1u, before_low + first.x < before_low);
    let after = before_high + middle;
    let wraps = select(0u, 1u, middle < first.y) + select(0u, 1u, after < middle) + select(0u, 1u, after + from_low < after);
    let carried = vec2<u32>(first.y + from_low, second.y + wraps);
    if (any(carried != vec2<u32>(0u))) {
        atomicAdd(&sums[place + 1u], (u64(carried.y) << 32u) | u64(carried.x));
    }
}

// Adds the carries of a fragment. They are rare, so one loop over all pairs costs less than a
// branch for each.
fn settle_stored(pixel: u32) {
    while (carries != 0u) {
        let pair = firstTrailingBit(carries) / 3u;
        let wraps = (carries >> (3u * pair)) & 7u;
        atomicAdd(&sums[pixel * CHANNELS + 2u * pair + 1u], (u64(wraps >> 1u) << 32u) | u64(wraps & 1u));
        carries &= ~(7u << (3u * pair));
    }
}

// The finished sums: for each pair its sums and its carries.
@group(0) @binding(37) var<storage, read> added: array<vec2<u64>>;

// The sums of the pixel that show() loaded, low and high words. Both sums of a pair are read at
// once.
var<private> shown_low: array<u32, 18>;
var<private> shown_high: array<u32, 18>;

fn show_pair(pixel: u32, pair: u32) {
    let of_pair = added[pixel * (CHANNELS / 2u) + pair];
    let high = u32(of_pair.x >> 32u);
    let from_low = u32(of_pair.y & 0xfffffffflu);
    shown_low[2u * pair] = u32(of_pair.x & 0xfffffffflu);
    shown_high[2u * pair] = from_low;
    shown_low[2u * pair + 1u] = high - from_low;
    shown_high[2u * pair + 1u] = u32(of_pair.y >> 32u) - select(0u, 1u, high < from_low);
}

fn show(pixel: u32) {
    for (var pair = 0u; pair < CHANNELS / 2u; pair++) {
        show_pair(pixel, pair);
    }
}

// Returns a sum of the loaded pixel, in units of the terms. The unit cancels in ratios of two sums.
fn sum_at(pixel: u32, channel: u32) -> f32 {
    return f32(shown_high[channel]) * 4294967296.0 + f32(shown_low[channel]);
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / ONE;
}
