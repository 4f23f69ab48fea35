// #import *::{Term}

struct Place {
    nothing: u32,
}

fn place_of(index: u32) -> Place {
    return Place(0u);
}

fn accumulate_place(pixel: u32, weight: Term, place: Place, at: vec2<u32>, depth: f32) {}

fn accumulate_stored_place(pixel: u32, weight: Term, place: Place, depth: f32) {}

fn textured(pixel: u32, weight: f32, blended: vec4<f32>) -> vec4<f32> {
    return blended;
}

fn mean_place(pixel: u32, weight: f32) -> vec2<f32> {
    return vec2<f32>(0.0);
}
