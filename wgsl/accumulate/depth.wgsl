// Sums of depths. Accepted fragments lie between the nearest depth and the tolerance behind it, so
// their position in that interval is summed: its error is 2^-24 of epsilon, not of the scene's
// depth. Fragments of other cuts, which may lie in front of the interval (fade.wgsl), count as
// nearest.
// Twins: src/passes/accumulate.rs, src/passes/resolve.rs.
// #import *::{Term, add, sum_at, term}
// #import epsilon_*::{deepest_accepted}

override DEPTH_CHANNEL: u32;

fn accumulate_depth(pixel: u32, weight: Term, depth: f32, front: f32) {
    add(pixel, DEPTH_CHANNEL, term(weight, (depth - front) / (deepest_accepted(front) - front)));
}

// The mean depth, device units.
fn surface_depth(pixel: u32, weight: f32, front: f32) -> f32 {
    let mean = sum_at(pixel, DEPTH_CHANNEL) / weight;
    return front + mean * (deepest_accepted(front) - front);
}
