// The sums of accumulator_fixed.wgsl or accumulator_fixed_wide.wgsl, bit for bit, in the registers
// of a tile (tile.wgsl). They are added to the sums in storage at the end, if those exist. `pixel`
// is the pixel's slot in the column.
// #import *::{Term}
// #import staged_sums|tile_sums::{add_words}
// #import terms|terms_wide::{term_words}

@group(0) @binding(8) var<storage, read_write> sums: array<u32>;

fn add(pixel: u32, channel: u32, value: Term) {
    let term = term_words(value);
    add_words(pixel, channel, term.x, term.y);
}
