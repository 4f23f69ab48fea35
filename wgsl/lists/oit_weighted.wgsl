// Order-independent transparency by weights that fall with depth (McGuire and Bavoil 2013, Eq. 10).
// Same interface as oit_moments.wgsl.
// Twin: src/passes/oit.rs.
// #import *::{sum_at}
// #import accumulator_raster|visibility::{nearest}
// #import footprint::{band_pixels}
// #import layout::{WEIGHT_CHANNEL, WORKGROUP, hold, linear_index}
// #import oit::{depth_fraction}

// LEAST_OF_DEPTH in the twin.
const LEAST_OF_DEPTH: f32 = 1.0 / 300000.0;

fn weight_before(pixel: u32, depth: f32, weight: f32) -> f32 {
    let left = 1.0 - depth_fraction(depth);
    return weight * max(left * left * left, LEAST_OF_DEPTH);
}

// Marks the pixels that are not empty, from their sums, as there is no visibility pass. One
// invocation per pixel.
@compute @workgroup_size(WORKGROUP)
fn mark_covered(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let pixel = linear_index(workgroup, workgroups, local);
    if (pixel < band_pixels()) {
        atomicStore(&nearest[pixel], select(0u, 1u, sum_at(pixel, WEIGHT_CHANNEL) > 0.0));
    }
}
