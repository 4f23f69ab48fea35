// Visibility pass that counts the fragments of each pixel, for the pixels' lists. Same interface as
// nearest_depth.wgsl. Host side: src/passes/fragments.rs.
// #import accumulator_raster|visibility::{nearest}
// #import camera_orthographic|perspective::{Fragment}
// #import layout::{NOTHING}

fn mark_of(surfel: u32) -> u32 {
    return 0u;
}

fn keep_nearest(pixel: u32, fragment: Fragment, mark: u32) {
    atomicAdd(&nearest[pixel], 1u);
}

// Counts are stored, not depths: returns 1 if the pixel has a fragment, else NOTHING.
fn nearest_at(pixel: u32) -> u32 {
    return select(NOTHING, 1u, atomicLoad(&nearest[pixel]) != 0u);
}

// All fragments are listed.
fn is_before_end(pixel: u32, depth: f32) -> bool {
    return true;
}
