// Epsilon as a length along the pixel's view ray (paper 000, section 5.3), which spans less depth
// toward the image's corners. Same interface as epsilon_depth.wgsl. Twin: src/passes/accumulate.rs.
// #import camera_*::{along_axis}
// #import layout::{held}

fn radius_of(index: u32) -> f32 {
    return 0.0;
}

// The farthest accepted depth on the camera's axis, where the length spans the most depth.
fn deepest_accepted(front: f32) -> f32 {
    return min(front + (front * held.epsilon_relative + held.epsilon_absolute), held.farthest);
}

fn farthest_accepted(front: f32, radius: f32) -> f32 {
    return deepest_accepted(front);
}

fn farthest_shown(front: f32, radius: f32, image: vec2<f32>) -> f32 {
    return min(front + (front * held.epsilon_relative + held.epsilon_absolute * along_axis(image)), held.farthest);
}
