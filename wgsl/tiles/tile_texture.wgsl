// Tiles of textured surfels, which have more channels. Same interface as tile_plain.wgsl.
// #import *::{CHANNELS}
// #import accumulator_fixed_pairs|tile_sums::{show_pair}

const MOST_CHANNELS: u32 = 18u;

// Reads the channels that only textured surfels have.
fn show_rest(slot: u32) {
    if (CHANNELS > 12u) { show_pair(slot, 12u); }
    if (CHANNELS > 14u) { show_pair(slot, 14u); }
    if (CHANNELS > 16u) { show_pair(slot, 16u); }
}
