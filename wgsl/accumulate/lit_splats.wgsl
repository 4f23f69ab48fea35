// Splats are lit, each at its centre, and the lit colours are blended ("complete per-vertex
// illumination", paper 000, section 5.3). No normals are summed. Same interface as lit_pixels.wgsl.
// Twin: src/passes/lit.rs.
// #import camera_orthographic|perspective::{ray_to}
// #import center|center_doubled::{relative_center}
// #import layout::{AWAY, Splat}
// #import normal_*::{surfel_normal}
// #import shade_*::{shade}
// #import words|words_long::{surfel_at}

// Set if surfels have no side, and are lit as if they faced the viewer. Otherwise a surfel is lit
// on the side of its normal.
override TURNS_LIT: bool;

fn lit(premultiplied: vec4<f32>, index: u32, splat: Splat) -> vec4<f32> {
    let alpha = premultiplied.a;
    let color = select(vec3<f32>(0.0), premultiplied.rgb / alpha, alpha > 0.0);
    let own = surfel_normal(index);
    let normal = select(own, -own, TURNS_LIT && (splat.bounds_last & AWAY) != 0u);
    let relative = relative_center(index, surfel_at(index));
    let toward_eye = -ray_to(vec3<f32>(relative[0].high, relative[1].high, relative[2].high));
    return vec4<f32>(shade(color, normal, toward_eye) * alpha, alpha);
}

fn shade_pixel(color: vec3<f32>, normal: vec3<f32>, x: u32, y: u32) -> vec3<f32> {
    return color;
}
