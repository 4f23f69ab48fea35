// The registers of tile.wgsl's sums: of eight pixels and at most twelve channels, low and high word.

override CHANNELS: u32;

const MOST_CHANNELS: u32 = 12u;
var<private> kept_low: array<u32, 96>;
var<private> kept_high: array<u32, 96>;

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

// What the registers hold, in the units of the terms.
fn sum_at(pixel: u32, channel: u32) -> f32 {
    let at = pixel * MOST_CHANNELS + channel;
    return f32(kept_high[at]) * 4294967296.0 + f32(kept_low[at]);
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / ONE;
}

// Adds the registers of pixel `slot` to the stored sums of `pixel`. Written out, so that no register is indexed by a number
// that only the device knows.
fn deposit(slot: u32, pixel: u32) {
    deposit_pair(slot, pixel, 0u);
    if (CHANNELS > 2u) { deposit_pair(slot, pixel, 2u); }
    if (CHANNELS > 4u) { deposit_pair(slot, pixel, 4u); }
    if (CHANNELS > 6u) { deposit_pair(slot, pixel, 6u); }
    if (CHANNELS > 8u) { deposit_pair(slot, pixel, 8u); }
    if (CHANNELS > 10u) { deposit_pair(slot, pixel, 10u); }
}

fn deposit_pair(slot: u32, pixel: u32, channel: u32) {
    let at = slot * MOST_CHANNELS + channel;
    let first = vec2<u32>(kept_low[at], kept_high[at]);
    let second = vec2<u32>(kept_low[at + 1u], kept_high[at + 1u]);
    deposit_sums(pixel, channel, first, second);
}

// The sum of two 64-bit numbers, each low and high word.
fn sum_words(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}
