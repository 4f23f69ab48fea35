// The registers of tile.wgsl's sums: of sixteen pixels and at most twelve channels, low and high word.
// All loops end, by 1 of src/gpu/loops.rs: 0xa79ad67f78e78da1

override CHANNELS: u32;

const MOST_CHANNELS: u32 = 12u;
var<private> kept_low: array<u32, 192>;
var<private> kept_high: array<u32, 192>;

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

// The sums of the pixel that is shown.
var<private> shown_low: array<u32, 12>;
var<private> shown_high: array<u32, 12>;

fn show_channel(slot: u32, channel: u32) {
    var low = kept_low[channel];
    var high = kept_high[channel];
    if (slot == 1u) { low = kept_low[12u + channel]; high = kept_high[12u + channel]; }
    if (slot == 2u) { low = kept_low[24u + channel]; high = kept_high[24u + channel]; }
    if (slot == 3u) { low = kept_low[36u + channel]; high = kept_high[36u + channel]; }
    if (slot == 4u) { low = kept_low[48u + channel]; high = kept_high[48u + channel]; }
    if (slot == 5u) { low = kept_low[60u + channel]; high = kept_high[60u + channel]; }
    if (slot == 6u) { low = kept_low[72u + channel]; high = kept_high[72u + channel]; }
    if (slot == 7u) { low = kept_low[84u + channel]; high = kept_high[84u + channel]; }
    if (slot == 8u) { low = kept_low[96u + channel]; high = kept_high[96u + channel]; }
    if (slot == 9u) { low = kept_low[108u + channel]; high = kept_high[108u + channel]; }
    if (slot == 10u) { low = kept_low[120u + channel]; high = kept_high[120u + channel]; }
    if (slot == 11u) { low = kept_low[132u + channel]; high = kept_high[132u + channel]; }
    if (slot == 12u) { low = kept_low[144u + channel]; high = kept_high[144u + channel]; }
    if (slot == 13u) { low = kept_low[156u + channel]; high = kept_high[156u + channel]; }
    if (slot == 14u) { low = kept_low[168u + channel]; high = kept_high[168u + channel]; }
    if (slot == 15u) { low = kept_low[180u + channel]; high = kept_high[180u + channel]; }
    shown_low[channel] = low;
    shown_high[channel] = high;
}

fn show_pair(slot: u32, channel: u32) {
    show_channel(slot, channel);
    show_channel(slot, channel + 1u);
}

// Takes the sums of a pixel out of the registers. Written out, so that no register is indexed by a number that only the
// device knows.
fn show(slot: u32) {
    show_pair(slot, 0u);
    if (CHANNELS > 2u) { show_pair(slot, 2u); }
    if (CHANNELS > 4u) { show_pair(slot, 4u); }
    if (CHANNELS > 6u) { show_pair(slot, 6u); }
    if (CHANNELS > 8u) { show_pair(slot, 8u); }
    if (CHANNELS > 10u) { show_pair(slot, 10u); }
}

// A sum of the shown pixel, in the units of the terms.
fn sum_at(slot: u32, channel: u32) -> f32 {
    return f32(shown_high[channel]) * 4294967296.0 + f32(shown_low[channel]);
}

fn weight_at(slot: u32) -> f32 {
    return sum_at(slot, WEIGHT_CHANNEL) / ONE;
}

// Adds the sums of the shown pixel to those that are stored of `pixel`.
fn deposit(pixel: u32) {
    for (var channel = 0u; channel < CHANNELS; channel += 2u) {
        let first = vec2<u32>(shown_low[channel], shown_high[channel]);
        let second = vec2<u32>(shown_low[channel + 1u], shown_high[channel + 1u]);
        deposit_sums(pixel, channel, first, second);
    }
}

// The sum of two 64-bit numbers, each low and high word.
fn sum_words(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}
