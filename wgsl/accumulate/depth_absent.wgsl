// No depths are summed: the depth of a surface is that of its nearest fragment. Same interface as
// depth.wgsl.
// #import *::{Term}

fn accumulate_depth(pixel: u32, weight: Term, depth: f32, front: f32) {}

fn surface_depth(pixel: u32, weight: f32, front: f32) -> f32 {
    return front;
}
