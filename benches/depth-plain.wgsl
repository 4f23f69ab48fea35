// The blended depth as Tien 2008 has it (section 5.2): each fragment counts with its weight, not
// with the square of its weight. In place of depth_middles.wgsl.
// #import *::{Term, add, part_of, sum_at, term}
// #import epsilon_*::{deepest_accepted}

override DEPTH_CHANNEL: u32;
override MIDDLES_CHANNEL: u32;

fn accumulate_depth(pixel: u32, weight: Term, depth: f32, front: f32) {
    add(pixel, MIDDLES_CHANNEL, weight);
    add(pixel, DEPTH_CHANNEL, term(weight, (depth - front) / (deepest_accepted(front) - front)));
}

fn surface_depth(pixel: u32, weight: f32, front: f32) -> f32 {
    let middles = sum_at(pixel, MIDDLES_CHANNEL);
    let mean = select(0.0, sum_at(pixel, DEPTH_CHANNEL) / middles, middles > 0.0);
    return front + mean * (deepest_accepted(front) - front);
}
