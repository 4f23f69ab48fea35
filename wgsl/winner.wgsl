// Where the nearest fragment alone shows: a pixel has nothing to sum, and its one fragment weighs 1. In place of blend.wgsl, a kernel's
// weights, an accumulator and the sums of colours.
// Twin: src/passes/winner.rs.

alias Term = u32;

struct Attributes {
    // The colour, as surfels have it.
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
