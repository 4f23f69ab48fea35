// Depth where surfaces are told apart by it. A disk touches its surface in its middle and stands out from it by the square of the
// distance from there, so a fragment counts by the square of its weight here: what is blended is less than two thirds as far out.
// Same interface as depth.wgsl. Twin: src/passes/accumulate.rs, src/passes/resolve.rs.

override DEPTH_CHANNEL: u32;
// Of the weights of depths.
override MIDDLES_CHANNEL: u32;

// LEAST_MIDDLE in src/passes/accumulate.rs.
const LEAST_MIDDLE: f32 = 0.00390625;

fn accumulate_depth(pixel: u32, weight: Term, depth: f32, front: f32) {
    let squared = term(weight, max(part_of(weight), LEAST_MIDDLE));
    add(pixel, MIDDLES_CHANNEL, squared);
    add(pixel, DEPTH_CHANNEL, term(squared, (depth - front) / (deepest_accepted(front) - front)));
}

// Device units. Accumulators of few bits may have nothing left of small weights.
fn surface_depth(pixel: u32, weight: f32, front: f32) -> f32 {
    let middles = sum_at(pixel, MIDDLES_CHANNEL);
    let mean = select(0.0, sum_at(pixel, DEPTH_CHANNEL) / middles, middles > 0.0);
    return front + mean * (deepest_accepted(front) - front);
}
