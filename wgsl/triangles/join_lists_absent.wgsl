// No triangles: lists show splats only. Same interface as join_lists.wgsl.
// #import resolve_lists::{Shown}

fn triangle_depth(x: u32, y: u32) -> f32 {
    return 0.0;
}

fn is_behind_triangle(depth: f32, triangle: f32) -> bool {
    return false;
}

fn has_triangle(triangle: f32) -> bool {
    return false;
}

fn with_triangle(shown: Shown, depth: f32, out: u32, x: u32, y: u32) -> Shown {
    return shown;
}
