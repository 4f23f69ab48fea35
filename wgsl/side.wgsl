// Which side of an oriented surface a pixel sees: beside the normal, the weight of the fragments whose normals were turned.
// Twin: src/passes/accumulate.rs, src/passes/resolve.rs.

override SIDE_CHANNEL: u32;

fn accumulate_side(pixel: u32, weight: Term, turned: f32) {
    if (turned > 0.0) {
        add(pixel, SIDE_CHANNEL, term(weight, turned));
    }
}

// -1 where most of the weight has been turned, so that the mean is turned back.
fn side_at(pixel: u32, weight: f32) -> f32 {
    return select(1.0, -1.0, sum_at(pixel, SIDE_CHANNEL) > 0.5 * weight);
}
