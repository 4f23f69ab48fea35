// Epsilon as a multiple of the shorter half-axis of the fragment's own surfel. Same interface as
// epsilon_depth.wgsl. Twin: src/passes/accumulate.rs.
// #import layout::{held}
// #import vectors::{norm3}
// #import words|words_long::{surfel_at}

// The shorter half-axis, device units.
fn radius_of(index: u32) -> f32 {
    let surfel = surfel_at(index);
    let s = vec3<f32>(surfel.s[0], surfel.s[1], surfel.s[2]) * held.unit;
    let t = vec3<f32>(surfel.t[0], surfel.t[1], surfel.t[2]) * held.unit;
    return min(norm3(s), norm3(t));
}

// The farthest accepted depth for the largest surfel, to which depth sums are scaled (depth.wgsl).
fn deepest_accepted(front: f32) -> f32 {
    let epsilon = min(held.epsilon_deepest, front * held.epsilon_most);
    return min(front + (front * held.epsilon_relative + epsilon), held.farthest);
}

fn farthest_accepted(front: f32, radius: f32) -> f32 {
    let epsilon = min(held.epsilon_radius * radius, front * held.epsilon_most);
    return min(front + (front * held.epsilon_relative + epsilon), held.farthest);
}

fn farthest_shown(front: f32, radius: f32, image: vec2<f32>) -> f32 {
    return farthest_accepted(front, radius);
}
