// The farthest depth that belongs to the surface whose nearest depth is `front` (paper 000, section
// 5.3), with the same epsilon for every surfel. Twin: src/passes/accumulate.rs.
// #import layout::{held}

fn radius_of(index: u32) -> f32 {
    return 0.0;
}

fn deepest_accepted(front: f32) -> f32 {
    return min(front + (front * held.epsilon_relative + held.epsilon_absolute), held.farthest);
}

// The greatest value of farthest_shown at any pixel, for bounds.
fn farthest_accepted(front: f32, radius: f32) -> f32 {
    return deepest_accepted(front);
}

// The farthest accepted depth at a point of the image.
fn farthest_shown(front: f32, radius: f32, image: vec2<f32>) -> f32 {
    return farthest_accepted(front, radius);
}
