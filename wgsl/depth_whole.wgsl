// Depth where the nearest one is not known while summing: as a fraction of the farthest there is, so that its error is
// that of the scene's depth, not of epsilon. Twin: src/passes/accumulate.rs, src/passes/resolve.rs.

override DEPTH_CHANNEL: u32;

fn accumulate_depth(pixel: u32, weight: Term, depth: f32, front: f32) {
    add(pixel, DEPTH_CHANNEL, term(weight, depth / held.farthest));
}

fn surface_depth(pixel: u32, weight: f32, front: f32) -> f32 {
    return sum_at(pixel, DEPTH_CHANNEL) / weight * held.farthest;
}
