// The registers for the sums of tile.wgsl: low and high words of up to MOST_CHANNELS channels
// (tile_plain.wgsl, tile_texture.wgsl) of sixteen pixels.
// All loops end, by 1 of src/gpu/loops.rs: 0x341f38aad74f5326
// #import *::{Term, add}
// #import layout::{WEIGHT_CHANNEL}
// #import terms|terms_wide::{ONE}
// #import tile_*::{MOST_CHANNELS, deposit_sums, show_rest}

override CHANNELS: u32;

var<private> kept_low: array<u32, 16u * MOST_CHANNELS>;
var<private> kept_high: array<u32, 16u * MOST_CHANNELS>;

fn add_words(pixel: u32, channel: u32, low: u32, high: u32) {
    let at = pixel * MOST_CHANNELS + channel;
    let sum = kept_low[at] + low;
    kept_high[at] += high + select(0u, 1u, sum < low);
    kept_low[at] = sum;
}

fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

fn settle(pixel: u32) {}

// The sums of the pixel that show() has read.
var<private> shown_low: array<u32, MOST_CHANNELS>;
var<private> shown_high: array<u32, MOST_CHANNELS>;

fn show_channel(slot: u32, channel: u32) {
    var low = kept_low[channel];
    var high = kept_high[channel];
    if (slot == 1u) { low = kept_low[MOST_CHANNELS + channel]; high = kept_high[MOST_CHANNELS + channel]; }
    if (slot == 2u) { low = kept_low[2u * MOST_CHANNELS + channel]; high = kept_high[2u * MOST_CHANNELS + channel]; }
    if (slot == 3u) { low = kept_low[3u * MOST_CHANNELS + channel]; high = kept_high[3u * MOST_CHANNELS + channel]; }
    if (slot == 4u) { low = kept_low[4u * MOST_CHANNELS + channel]; high = kept_high[4u * MOST_CHANNELS + channel]; }
    if (slot == 5u) { low = kept_low[5u * MOST_CHANNELS + channel]; high = kept_high[5u * MOST_CHANNELS + channel]; }
    if (slot == 6u) { low = kept_low[6u * MOST_CHANNELS + channel]; high = kept_high[6u * MOST_CHANNELS + channel]; }
    if (slot == 7u) { low = kept_low[7u * MOST_CHANNELS + channel]; high = kept_high[7u * MOST_CHANNELS + channel]; }
    if (slot == 8u) { low = kept_low[8u * MOST_CHANNELS + channel]; high = kept_high[8u * MOST_CHANNELS + channel]; }
    if (slot == 9u) { low = kept_low[9u * MOST_CHANNELS + channel]; high = kept_high[9u * MOST_CHANNELS + channel]; }
    if (slot == 10u) { low = kept_low[10u * MOST_CHANNELS + channel]; high = kept_high[10u * MOST_CHANNELS + channel]; }
    if (slot == 11u) { low = kept_low[11u * MOST_CHANNELS + channel]; high = kept_high[11u * MOST_CHANNELS + channel]; }
    if (slot == 12u) { low = kept_low[12u * MOST_CHANNELS + channel]; high = kept_high[12u * MOST_CHANNELS + channel]; }
    if (slot == 13u) { low = kept_low[13u * MOST_CHANNELS + channel]; high = kept_high[13u * MOST_CHANNELS + channel]; }
    if (slot == 14u) { low = kept_low[14u * MOST_CHANNELS + channel]; high = kept_high[14u * MOST_CHANNELS + channel]; }
    if (slot == 15u) { low = kept_low[15u * MOST_CHANNELS + channel]; high = kept_high[15u * MOST_CHANNELS + channel]; }
    shown_low[channel] = low;
    shown_high[channel] = high;
}

fn show_pair(slot: u32, channel: u32) {
    show_channel(slot, channel);
    show_channel(slot, channel + 1u);
}

// Reads the sums of a pixel from the registers. The calls are written out, so that no register is
// indexed by a run-time value.
fn show(slot: u32) {
    show_pair(slot, 0u);
    if (CHANNELS > 2u) { show_pair(slot, 2u); }
    if (CHANNELS > 4u) { show_pair(slot, 4u); }
    if (CHANNELS > 6u) { show_pair(slot, 6u); }
    if (CHANNELS > 8u) { show_pair(slot, 8u); }
    if (CHANNELS > 10u) { show_pair(slot, 10u); }
    show_rest(slot);
}

// A sum of the shown pixel, in the units of the terms.
fn sum_at(slot: u32, channel: u32) -> f32 {
    return f32(shown_high[channel]) * 4294967296.0 + f32(shown_low[channel]);
}

fn weight_at(slot: u32) -> f32 {
    return sum_at(slot, WEIGHT_CHANNEL) / ONE;
}

// Adds the sums of the shown pixel to the stored ones of `pixel`.
fn deposit(pixel: u32) {
    for (var channel = 0u; channel < CHANNELS; channel += 2u) {
        let first = vec2<u32>(shown_low[channel], shown_high[channel]);
        let second = vec2<u32>(shown_low[channel + 1u], shown_high[channel + 1u]);
        deposit_sums(pixel, channel, first, second);
    }
}

// The sum of two 64-bit numbers (low word, high word).
fn sum_words(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}
