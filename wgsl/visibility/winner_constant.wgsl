// All surfels have one colour, so the nearest depth is all that is needed. Same interface as
// winner_color.wgsl.
// #import layout::{held}

fn resolve_color(pixel: u32, weight: f32) -> vec4<f32> {
    return held.color_low;
}
