// Finds the nearest triangle of a pixel in two passes over the fragments: its depth, then its
// index. Both passes evaluate the same crossing, so the nearest fragment has exactly the stored
// depth. Same interface as triangles_once.wgsl.
// #import footprint::{TILE}
// #import layout::{WORKGROUP, hold, linear_index}
// #import triangles_visibility::{draw_large, draw_rare, draw_small}

// Per pixel the index, then the kept depth. Cleared words mean an empty pixel.
@group(0) @binding(58) var<storage, read_write> nearest_triangles: array<atomic<u32>>;

// Whether this is the pass that stores indices.
var<private> names: bool;

fn keep_triangle(pixel: u32, kept: u32, number: u32) {
    if (names) {
        if (kept == atomicLoad(&nearest_triangles[2u * pixel + 1u])) {
            atomicMax(&nearest_triangles[2u * pixel], number);
        }
    } else if (kept > atomicLoad(&nearest_triangles[2u * pixel + 1u])) {
        atomicMax(&nearest_triangles[2u * pixel + 1u], kept);
    }
}

@compute @workgroup_size(WORKGROUP)
fn name_triangles(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    names = true;
    draw_small(linear_index(workgroup, workgroups, local), false);
}

@compute @workgroup_size(TILE, TILE)
fn name_large_triangles(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    names = true;
    draw_large(workgroup.y * workgroups.x + workgroup.x, local.xy);
}

@compute @workgroup_size(TILE, TILE)
fn name_rare_triangles(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    names = true;
    draw_rare(workgroup.y * workgroups.x + workgroup.x, local.xy);
}
