// Pictures in which only the nearest fragment shows: it has weight 1, and nothing is summed. This
// file replaces blend.wgsl, the kernel's weights, the accumulator and the sums of colours.
// Twin: src/passes/winner.rs.
// #import attributes::{attribute_word}
// #import epsilon_*::{radius_of}
// #import layout::{Splat}

alias Term = u32;

struct Attributes {
    // The colour, as in the surfel's attributes.
    word: u32,
    radius: f32,
}

fn attributes_of(index: u32, splat: Splat) -> Attributes {
    return Attributes(attribute_word(index, 0u), radius_of(index));
}

fn show(pixel: u32) {}

fn sum_at(pixel: u32, channel: u32) -> f32 {
    return 1.0;
}

fn weight_at(pixel: u32) -> f32 {
    return 1.0;
}
