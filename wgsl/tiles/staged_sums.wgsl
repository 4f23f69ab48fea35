// The registers for the sums of one pixel (staged.wgsl): low and high words of each channel. Same
// interface as tile_sums.wgsl.
// All loops end, by 1 of src/gpu/loops.rs: 0x52ac0a4df8ee3d80
// #import *::{Term, add}
// #import layout::{WEIGHT_CHANNEL}
// #import terms|terms_wide::{ONE}
// #import tile_*::{deposit_sums}

override CHANNELS: u32;

// As many as textured surfels have; a compiler drops those that are not used.
const ROOM: u32 = 18u;

var<private> kept_low: array<u32, ROOM>;
var<private> kept_high: array<u32, ROOM>;

fn add_words(pixel: u32, channel: u32, low: u32, high: u32) {
    let sum = kept_low[channel] + low;
    kept_high[channel] += high + select(0u, 1u, sum < low);
    kept_low[channel] = sum;
}

fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

fn settle(pixel: u32) {}

// The registers can be read as they are.
fn show(slot: u32) {}

// A sum of the pixel, in the units of the terms.
fn sum_at(slot: u32, channel: u32) -> f32 {
    return f32(kept_high[channel]) * 4294967296.0 + f32(kept_low[channel]);
}

fn weight_at(slot: u32) -> f32 {
    return sum_at(slot, WEIGHT_CHANNEL) / ONE;
}

// Adds the sums to the stored ones of `pixel`.
fn deposit(pixel: u32) {
    for (var channel = 0u; channel < CHANNELS; channel += 2u) {
        let first = vec2<u32>(kept_low[channel], kept_high[channel]);
        let second = vec2<u32>(kept_low[channel + 1u], kept_high[channel + 1u]);
        deposit_sums(pixel, channel, first, second);
    }
}

// The sum of two 64-bit numbers (low word, high word).
fn sum_words(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}
