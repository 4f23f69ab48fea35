// All surfels have the same colour: it is neither stored nor summed, and every pixel gets it
// exactly.
// #import *::{Term, add}
// #import layout::{Splat, WEIGHT_CHANNEL, held}

fn color_of(index: u32, splat: Splat) -> vec4<f32> {
    return vec4<f32>(0.0);
}

fn surfel_alpha(index: u32) -> f32 {
    return held.color_low.a;
}

fn accumulate_color(pixel: u32, weight: Term, color: vec4<f32>) {
    add(pixel, WEIGHT_CHANNEL, weight);
}

fn resolve_color(pixel: u32, weight: f32) -> vec4<f32> {
    return held.color_low;
}
