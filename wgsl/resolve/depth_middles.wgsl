// Sums of depths for pictures that compare surfaces by their blended depths. A disk touches the
// surface at the disk's centre; elsewhere it stands out from the surface by the square of the
// distance from the centre. So depths are summed with the square of the fragment's weight, which
// moves the blended depth to less than two thirds as far from the surface.
// Same interface as depth.wgsl. Twins: src/passes/accumulate.rs, src/passes/resolve.rs.
// #import *::{Term, add, part_of, sum_at, term}
// #import epsilon_*::{deepest_accepted}

override DEPTH_CHANNEL: u32;
// The channel of the sum of these squared weights.
override MIDDLES_CHANNEL: u32;

// LEAST_MIDDLE in src/passes/accumulate.rs.
const LEAST_MIDDLE: f32 = 0.00390625;

fn accumulate_depth(pixel: u32, weight: Term, depth: f32, front: f32) {
    let squared = term(weight, max(part_of(weight), LEAST_MIDDLE));
    add(pixel, MIDDLES_CHANNEL, squared);
    add(pixel, DEPTH_CHANNEL, term(squared, (depth - front) / (deepest_accepted(front) - front)));
}

// The mean depth, device units. In an accumulator of few bits, small weights may have rounded to 0;
// the depth is then the nearest one.
fn surface_depth(pixel: u32, weight: f32, front: f32) -> f32 {
    let middles = sum_at(pixel, MIDDLES_CHANNEL);
    let mean = select(0.0, sum_at(pixel, DEPTH_CHANNEL) / middles, middles > 0.0);
    return front + mean * (deepest_accepted(front) - front);
}
