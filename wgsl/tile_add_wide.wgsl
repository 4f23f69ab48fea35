// The sums of accumulator_fixed_wide.wgsl, bit for bit, of the pixels of an invocation of tile.wgsl: in registers, and
// added to those in storage at the end, if they are stored. `pixel` is which of them.

@group(0) @binding(8) var<storage, read_write> sums: array<u32>;

fn add(pixel: u32, channel: u32, value: Term) {
    let term = term_words(value);
    add_words(pixel, channel, term.x, term.y);
}
