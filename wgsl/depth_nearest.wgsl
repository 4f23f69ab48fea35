// The depth of the nearest fragment, which is the only one. Same interface as depth.wgsl.

override DEPTH_IMAGE: u32;

fn accumulate_depth(pixel: u32, weight: Term, depth: f32, front: f32) {}

fn write_depth(out: u32, pixel: u32, weight: f32, front: f32) {
    image[out + DEPTH_IMAGE] = front * held.world;
}

// +inf.
fn write_no_depth(out: u32) {
    image[out + DEPTH_IMAGE] = bitcast<f32>(NOTHING ^ held.zero);
}
