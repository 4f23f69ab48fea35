// Sums of premultiplied linear colour, each channel mapped from the scene's range to [0, 1] first.
// Channels: weight, red, green and blue, and alpha if it varies.
// Twins: src/passes/accumulate.rs, src/passes/resolve.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x6f35f0f1d6ce788c
// #import *::{Term, add, add_pair, sum_at, term}
// #import color_*::{premultiplied_color}
// #import layout::{Splat, WEIGHT_CHANNEL, held}
// #import lit_*::{lit}

const COLOR_CHANNEL: u32 = 1u;
// 3, or 4 if alpha varies.
override COLOR_CHANNELS: u32;

fn in_range(premultiplied: vec4<f32>) -> vec4<f32> {
    return (premultiplied - held.color_low) * held.color_scale;
}

fn color_of(index: u32, splat: Splat) -> vec4<f32> {
    return in_range(lit(premultiplied_color(index), index, splat));
}

fn accumulate_color(pixel: u32, weight: Term, color: vec4<f32>) {
    add_pair(pixel, WEIGHT_CHANNEL, weight, term(weight, color.r));
    add_pair(pixel, COLOR_CHANNEL + 1u, term(weight, color.g), term(weight, color.b));
    if (COLOR_CHANNELS == 4u) {
        add(pixel, COLOR_CHANNEL + 3u, term(weight, color.a));
    }
}

fn resolve_color(pixel: u32, weight: f32) -> vec4<f32> {
    var mean = vec4<f32>(0.0);
    for (var k = 0u; k < COLOR_CHANNELS; k++) {
        mean[k] = sum_at(pixel, COLOR_CHANNEL + k) / weight;
    }
    return held.color_low + held.color_span * mean;
}
