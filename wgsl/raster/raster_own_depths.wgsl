// Fragments write their own depths, and the attribute pass reads the nearest depths from the depth
// buffer. That buffer is not bound as a `texture_depth_2d`, because GLSL can only compare with such
// textures.
// #import footprint::{depth_scale}
// #import layout::{NOTHING, Splat, held, held_band}

@group(0) @binding(19) var nearest_depth: texture_2d<f32>;

fn corner_depth(splat: Splat, image: vec2<f32>, index: u32) -> f32 {
    return 0.0;
}

fn front_at(pixel: u32) -> f32 {
    let place = vec2<u32>(pixel % held.width, pixel / held.width + held_band.first_row);
    let depth = textureLoad(nearest_depth, place, 0).x;
    return select(depth / depth_scale(), bitcast<f32>(NOTHING ^ held.zero), depth == 1.0);
}
