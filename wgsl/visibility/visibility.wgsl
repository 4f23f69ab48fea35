// Stage 2: the nearest depth at every pixel. One invocation per splat, one workgroup per large
// splat. Where stage 1 draws small splats itself (project_draws.wgsl), the kernel `visibility` is
// left out. Depths are stored so that the nearest one is the greatest number (kept_depth in
// layout.wgsl).
// Twin: src/passes/visibility.rs.
// All loops end, by 1, 2 of src/gpu/loops.rs: 0x276af496a9cf6f78
// #import *::{keep_nearest, mark_of}
// #import cull|cull_absent|cull_twice::{slot_of, surfel_in}
// #import fade::{takes_sample}
// #import filter|lowpass_none::{Filter, filter_in}
// #import footprint::{TILE, footprint, is_large, large_splat, pixel_index, reach}
// #import layout::{Splat, WORKGROUP, hold}
// #import records::{SplatRecord, splat_of}

@group(0) @binding(5) var<storage, read> projected: array<SplatRecord>;
@group(0) @binding(6) var<storage, read_write> nearest: array<atomic<u32>>;

fn cover(splat: Splat, filter_: Filter, mark: u32, x: u32, y: u32) {
    let fragment = footprint(splat, filter_, x, y);
    if (fragment.hit && takes_sample(splat.fade, x, y)) {
        keep_nearest(pixel_index(x, y), fragment, mark);
    }
}

// Draws a small splat with one invocation. Large and empty ones have no pixels here.
fn draw_small_splat(splat: Splat, filter_: Filter, surfel: u32) {
    if (is_large(splat)) {
        return;
    }
    let pixels = reach(splat);
    let mark = mark_of(surfel);
    var at = pixels.first;
    while (at.y <= pixels.last.y) {
        cover(splat, filter_, mark, at.x, at.y);
        at.x++;
        at = select(at, vec2<u32>(pixels.first.x, at.y + 1u), at.x > pixels.last.x);
    }
}

@compute @workgroup_size(WORKGROUP)
fn visibility(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let slot = slot_of(workgroup, workgroups, local);
    if (slot >= arrayLength(&projected)) {
        return;
    }
    let record = projected[slot];
    draw_small_splat(splat_of(record), filter_in(record), surfel_in(record, slot));
}

@compute @workgroup_size(TILE, TILE)
fn visibility_large(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    let slot = large_splat(workgroup.y * workgroups.x + workgroup.x);
    if (slot >= arrayLength(&projected)) {
        return;
    }
    let record = projected[slot];
    let splat = splat_of(record);
    let pixels = reach(splat);
    let filter_ = filter_in(record);
    let mark = mark_of(surfel_in(record, slot));
    for (var y = pixels.first.y + local.y; y <= pixels.last.y; y += TILE) {
        for (var x = pixels.first.x + local.x; x <= pixels.last.x; x += TILE) {
            cover(splat, filter_, mark, x, y);
        }
    }
}
