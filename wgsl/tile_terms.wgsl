// The sums of accumulator_fixed.wgsl, bit for bit, of the eight pixels of an invocation of tile.wgsl: in registers, and added
// to those in storage at the end. `pixel` is which of the eight.

@group(0) @binding(8) var<storage, read_write> sums: array<u32>;

alias Term = u32;
const COUNT_ONE: Term = 1u;

// The units of a weight of 1.
const ONE: f32 = FIXED_ONE;

fn quantise(weight: f32) -> Term {
    return u32(round(weight * ONE));
}

fn term(weight: Term, value: f32) -> Term {
    return u32(round(f32(weight) * clamp(value, 0.0, 1.0)));
}

fn add(pixel: u32, channel: u32, value: Term) {
    add_words(pixel, channel, value, 0u);
}
