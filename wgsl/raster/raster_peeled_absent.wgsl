// One layer is drawn, and none comes before it. Same interface as raster_peeled.wgsl.
// #import camera_orthographic|perspective::{Fragment}

fn is_peeled(fragment: Fragment, radius: f32, pixel: vec2<u32>) -> bool {
    return false;
}
