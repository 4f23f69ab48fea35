// The depth map, in world units. Same interface as depth_map_absent.wgsl.
// #import image_*::{image}
// #import layout::{NOTHING, held}

override DEPTH_IMAGE: u32;

fn write_depth(out: u32, depth: f32) {
    image[out + DEPTH_IMAGE] = depth * held.world;
}

// An empty pixel has depth +inf.
fn write_no_depth(out: u32) {
    image[out + DEPTH_IMAGE] = bitcast<f32>(NOTHING ^ held.zero);
}
