// Depth. Accepted fragments lie between the nearest depth and the tolerance behind it, so their place in that interval
// is what is summed: its error is 2^-24 of epsilon, not of the scene.
// Twin: src/passes/accumulate.rs, src/passes/resolve.rs.

override DEPTH_WORD: u32;
override DEPTH_IMAGE: u32;

fn accumulate_depth(word: u32, weight: u32, depth: f32, front: f32, back: f32) {
    add(word + DEPTH_WORD, term(weight, (depth - front) / (back - front)));
}

fn write_depth(out: u32, word: u32, weight: f32, front: f32) {
    let mean = sum_at(word + DEPTH_WORD) / weight;
    image[out + DEPTH_IMAGE] = (front + mean * (farthest_accepted(front) - front)) * view.world;
}

// `front` is +inf where nothing is.
fn write_no_depth(out: u32, front: f32) {
    image[out + DEPTH_IMAGE] = front;
}
