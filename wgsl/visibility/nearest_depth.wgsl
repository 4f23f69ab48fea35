// Visibility pass that stores only the nearest depth of each pixel. Same interface as
// nearest_color.wgsl.
// #import accumulator_raster|visibility::{nearest}
// #import camera_orthographic|perspective::{Fragment}
// #import layout::{kept_depth}

fn mark_of(surfel: u32) -> u32 {
    return 0u;
}

fn keep_nearest(pixel: u32, fragment: Fragment, mark: u32) {
    atomicMax(&nearest[pixel], kept_depth(bitcast<u32>(fragment.depth)));
}

// The bits of the nearest depth. `visible` reads the same buffer.
fn nearest_at(pixel: u32) -> u32 {
    return kept_depth(atomicLoad(&nearest[pixel]));
}
