// The sums of accumulator_fixed_wide.wgsl, bit for bit, of the eight pixels of an invocation of tile.wgsl: in registers, and
// added to those in storage at the end. `pixel` is which of the eight.

@group(0) @binding(8) var<storage, read_write> sums: array<u32>;

alias Term = f32;
const COUNT_ONE: Term = 1.0;

// The units of a weight of 1: 2^40.
const ONE: f32 = 1099511627776.0;

const WORD: f32 = 4294967296.0;

fn quantise(weight: f32) -> Term {
    return weight * ONE;
}

fn term(weight: Term, value: f32) -> Term {
    return weight * clamp(value, 0.0, 1.0);
}

fn add(pixel: u32, channel: u32, value: Term) {
    let whole = floor(value / WORD);
    add_words(pixel, channel, u32(value - whole * WORD), u32(whole));
}
