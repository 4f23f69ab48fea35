// No tolerance: the nearest fragment alone is the surface. Same interface as epsilon_depth.wgsl.

fn radius_of(index: u32) -> f32 {
    return 0.0;
}

fn deepest_accepted(front: f32) -> f32 {
    return front;
}

fn farthest_accepted(front: f32, radius: f32) -> f32 {
    return front;
}

fn farthest_shown(front: f32, radius: f32, image: vec2<f32>) -> f32 {
    return farthest_accepted(front, radius);
}
