// Order-independent transparency: the optical depth -ln(1 - alpha) of all fragments of a pixel is
// summed beside their colours.
// Twin: src/passes/oit.rs.
// #import *::{add, quantise, sum_at, weight_at}
// #import layout::{held}
// #import resolve::{OPACITY}

override HELD_BACK_CHANNEL: u32;

// The divisor of optical depths, which are at most 28, so that a term is at most 1.
const HELD_BACK_UNITS: f32 = 32.0;
// LEAST_LEFT in the twin, 2^-40.
const LEAST_OIT_LEFT: f32 = 9.094947017729282379150390625e-13;

// The optical depth of an alpha. Small alphas use the first terms of the series, because 1 - alpha
// keeps few of their digits.
fn held_back(alpha: f32) -> f32 {
    let series = alpha * (1.0 + alpha * (0.5 + alpha * (1.0 / 3.0 + alpha * 0.25)));
    return select(-log(max(1.0 - alpha, LEAST_OIT_LEFT)), series, alpha < 0.015625);
}

fn accumulate_held_back(pixel: u32, weight: f32, color: vec4<f32>) {
    let alpha = weight * OPACITY * (held.color_low.a + held.color_span.a * color.a);
    add(pixel, HELD_BACK_CHANNEL, quantise(held_back(alpha) / HELD_BACK_UNITS));
}

// Replaces the mean alpha by the alpha of all fragments together. `weight` is in the units of the
// sums.
fn with_held_back(color: vec4<f32>, sums_of: u32, weight: f32) -> vec4<f32> {
    let sum = sum_at(sums_of, HELD_BACK_CHANNEL) / weight * weight_at(sums_of);
    return vec4<f32>(color.rgb, 1.0 - exp(-HELD_BACK_UNITS * sum));
}

// The position of a depth in the depth range of the scene's body, clamped to [0, 1].
fn depth_fraction(depth: f32) -> f32 {
    return clamp((depth - held.first) / max(held.last - held.first, 1e-30), 0.0, 1.0);
}
