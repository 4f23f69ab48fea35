// Stage 3: at every pixel, sums the weights and weighted attributes of the fragments within epsilon
// of the nearest depth. One invocation per splat, one workgroup per large splat. Integer
// accumulators quantise each fragment's terms before they add them, so their sums do not depend on
// the order.
// Twin: src/passes/accumulate.rs.
// All loops end, by 2, 4 of src/gpu/loops.rs: 0xadeec7902b0211fd
// #import *::{front_at}
// #import blend|winner::{attributes_of}
// #import blend|winner_second::{blend}
// #import camera_orthographic|perspective::{Fragment}
// #import cull|cull_absent|cull_twice::{surfel_in}
// #import filter|lowpass_none::{Filter, filter_in}
// #import footprint::{Rectangle, TILE, footprint, large_splat, pixel_index, reach}
// #import layout::{Splat, hold}
// #import raster|visibility::{projected}
// #import records::{splat_of}
// #import side::{is_shown}

// Accumulates the splat's pixels from `offset` on, in steps of `step`, with one invocation. Each
// round of the outer loop first finds the next fragment and then adds it if it is accepted. So the
// invocations of a subgroup, whose fragments lie at different pixels, do the expensive part
// together. Most fragments are accepted, because hidden splats were skipped.
fn accumulate_splat(surfel: u32, splat: Splat, filter_: Filter, pixels: Rectangle, offset: vec2<u32>, step: u32) {
    let first = pixels.first + offset;
    let attributes = attributes_of(surfel, splat);
    var at = select(first, vec2<u32>(0u, pixels.last.y + 1u), first.x > pixels.last.x);
    loop {
        var fragment: Fragment;
        var place: vec2<u32>;
        var hit = false;
        while (at.y <= pixels.last.y && !hit) {
            place = at;
            fragment = footprint(splat, filter_, at.x, at.y);
            hit = fragment.hit;
            at.x += step;
            let wrapped = at.x > pixels.last.x;
            at = select(at, vec2<u32>(first.x, at.y + step), wrapped);
        }
        if (!hit) {
            break;
        }
        let pixel = pixel_index(place.x, place.y);
        let front = front_at(pixel);
        if (is_shown(fragment, front, attributes.radius, place)) {
            blend(pixel, fragment, front, attributes);
        }
    }
}

@compute @workgroup_size(TILE, TILE)
fn accumulate_large(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    let slot = large_splat(workgroup.y * workgroups.x + workgroup.x);
    if (slot < arrayLength(&projected)) {
        let record = projected[slot];
        let splat = splat_of(record);
        accumulate_splat(surfel_in(record, slot), splat, filter_in(record), reach(splat), local.xy, TILE);
    }
}
