// The sums of accumulator_fixed.wgsl or accumulator_fixed_wide.wgsl, bit for bit, of surfels that stand for several: a term is
// multiplied by their number (copies.wgsl) before it is added. The twin multiplies too: src/passes/accumulate.rs.

override CHANNELS: u32;

@group(0) @binding(8) var<storage, read_write> sums: array<atomic<u32>>;

// a * b, low and high word, by halves of words.
fn product_words(a: u32, b: u32) -> vec2<u32> {
    let a_low = a & 0xffffu;
    let a_high = a >> 16u;
    let b_low = b & 0xffffu;
    let b_high = b >> 16u;
    // Each is at most (2^16 - 1)^2 + 2^16 - 1, which a word holds.
    let lowest = a_low * b_low;
    let one = a_high * b_low + (lowest >> 16u);
    let other = a_low * b_high + (one & 0xffffu);
    return vec2<u32>((other << 16u) | (lowest & 0xffffu), a_high * b_high + (one >> 16u) + (other >> 16u));
}

fn add(pixel: u32, channel: u32, value: Term) {
    let term = term_words(value);
    let all = product_words(term.x, times);
    let word = 2u * (pixel * CHANNELS + channel);
    let before = atomicAdd(&sums[word], all.x);
    let high = all.y + term.y * times + select(0u, 1u, before + all.x < before);
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
