// Pixels are lit: colours are blended unlit, and the mean is lit at the blended normal. Same
// interface as lit_splats.wgsl.
// #import camera_*::{ray}
// #import layout::{Splat}
// #import shade_*::{shade}

fn lit(premultiplied: vec4<f32>, index: u32, splat: Splat) -> vec4<f32> {
    return premultiplied;
}

fn shade_pixel(color: vec3<f32>, normal: vec3<f32>, x: u32, y: u32) -> vec3<f32> {
    return shade(color, normal, -ray(x, y));
}
