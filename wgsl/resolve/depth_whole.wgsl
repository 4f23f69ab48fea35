// Sums of depths where the nearest depth is not known yet. Depths are summed as fractions of the
// farthest depth in the scene, so their error is relative to that depth, not to epsilon. Same
// interface as depth.wgsl.
// Twins: src/passes/accumulate.rs, src/passes/resolve.rs.
// #import *::{Term, add, sum_at, term}
// #import layout::{held}

override DEPTH_CHANNEL: u32;

fn accumulate_depth(pixel: u32, weight: Term, depth: f32, front: f32) {
    add(pixel, DEPTH_CHANNEL, term(weight, depth / held.farthest));
}

fn surface_depth(pixel: u32, weight: f32, front: f32) -> f32 {
    return sum_at(pixel, DEPTH_CHANNEL) / weight * held.farthest;
}
