// No triangles: lists show splats only. Same interface as join_lists.wgsl.
// #import compositing::{NO_TRIANGLE}
// #import resolve_lists::{Shown}

fn triangle_depth(x: u32, y: u32) -> f32 {
    return NO_TRIANGLE;
}

fn with_triangle(shown: Shown, depth: f32, out: u32, x: u32, y: u32) -> Shown {
    return shown;
}
