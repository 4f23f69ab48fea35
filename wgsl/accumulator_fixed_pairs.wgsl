// The sums of accumulator_fixed.wgsl, bit for bit, for adapters with 64-bit atomics: two neighbouring sums in the halves
// of one u64, so that a fragment makes half as many additions. What wraps in the low half runs into the high one; both
// halves' carries are counted in a u64 of their own, which follows, so that it can be taken out again.
// Error bound: src/passes/accumulate.rs.
// All loops end, by 1, 3 of src/gpu/loops.rs: 0x8d89caff991eca3f

override CHANNELS: u32;

// For each pair of a pixel's channels a u64 of sums and one of carries.
@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u64>>;

// What wrapped under the fragment in work, three bits a pair: whether its low half did, and how often its high half, which
// carries reach twice where the halves are added one by one.
var<private> carries: u32;

fn add_halves(pixel: u32, pair: u32, low: Term, high: Term) {
    let before = atomicAdd(&sums[pixel * CHANNELS + 2u * pair], (u64(high) << 32u) | u64(low));
    let before_low = u32(before & 0xfffffffflu);
    let before_high = u32(before >> 32u);
    let from_low = select(0u, 1u, before_low + low < before_low);
    // A term is less than 2^32 - 1.
    let from_high = select(0u, 2u, before_high + (high + from_low) < before_high);
    carries += (from_low + from_high) << (3u * pair);
}

fn add(pixel: u32, channel: u32, value: Term) {
    let odd = (channel & 1u) == 1u;
    add_halves(pixel, channel >> 1u, select(value, 0u, odd), select(0u, value, odd));
}

fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add_halves(pixel, channel >> 1u, first, second);
}

// After a fragment's terms: carries are rare, so one loop over all pairs is less work than a branch for each.
fn settle(pixel: u32) {
    while (carries != 0u) {
        let pair = firstTrailingBit(carries) / 3u;
        let wraps = (carries >> (3u * pair)) & 7u;
        atomicAdd(&sums[pixel * CHANNELS + 2u * pair + 1u], (u64(wraps >> 1u) << 32u) | u64(wraps & 1u));
        carries &= ~(7u << (3u * pair));
    }
}

// The sums when all is added: sums and carries of a pair.
@group(0) @binding(37) var<storage, read> added: array<vec2<u64>>;

// The sums of the pixel that is shown, low and high words: both of a pair are read at once.
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

// A sum of the shown pixel, in the units of the terms; ratios of two sums have no unit.
fn sum_at(pixel: u32, channel: u32) -> f32 {
    return f32(shown_high[channel]) * 4294967296.0 + f32(shown_low[channel]);
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL) / ONE;
}
