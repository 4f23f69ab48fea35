// Adds the terms of fragments to the sums in storage. Same interface as sums_window.wgsl.
// #import *::{Term}
// #import accumulator_*::{add_pair_stored, add_stored, settle_stored}

fn add(pixel: u32, channel: u32, value: Term) {
    add_stored(pixel, channel, value);
}

// Adds to two neighbouring sums, of which the first has an even channel.
fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add_pair_stored(pixel, channel, first, second);
}

fn settle(pixel: u32) {
    settle_stored(pixel);
}
