// The index map, two words per pixel of the image: the greatest weight among the fragments within
// epsilon of the nearest depth, and the place in the scene of the surfel that has this weight. A
// first pass over the fragments finds the weights, a second pass the surfels.
// Twin: src/passes/index.rs.
// All loops end, by 1, 2 of src/gpu/loops.rs: 0x0e36003a44d83c69
// #import *::{front_at}
// #import blend::{fragment_weight}
// #import cull|cull_absent|cull_twice::{slot_of, surfel_in}
// #import epsilon_*::{radius_of}
// #import filter|lowpass_none::{Filter, filter_in}
// #import footprint::{TILE, footprint, is_large, large_splat, pixel_index, reach}
// #import layout::{Splat, WORKGROUP, hold, page}
// #import occlusion::{hidden}
// #import raster|visibility::{projected}
// #import records::{splat_of}
// #import resolve::{IMAGE_WORDS}
// #import side::{is_shown}

// The image. Only this pass writes the map's two words per pixel.
@group(0) @binding(41) var<storage, read_write> indexed: array<atomic<u32>>;

override INDEX_IMAGE: u32;

// Weights this close to the greatest, in units in the last place, count as equal: two kernels may
// round the same weight differently.
const AS_GREAT: u32 = 4u;

// The first of the two words of a pixel of the band.
fn index_word(pixel: u32) -> u32 {
    return pixel * IMAGE_WORDS + INDEX_IMAGE;
}

// Enters a fragment in the map: its weight or, if `names` is set and the weight is the greatest,
// the place of its surfel. Positive weights order as their bits. Places are stored as 2^32 - 1 -
// place, so that among equal weights the first surfel wins, and a cleared word means no surfel.
fn take(splat: Splat, filter_: Filter, surfel: u32, x: u32, y: u32, names: bool) {
    let fragment = footprint(splat, filter_, x, y);
    let pixel = pixel_index(x, y);
    if (!is_shown(fragment, front_at(pixel), radius_of(surfel), vec2<u32>(x, y))) {
        return;
    }
    let weight = bitcast<u32>(fragment_weight(fragment));
    let at = index_word(pixel);
    if (!names) {
        atomicMax(&indexed[at], weight);
    } else if (weight + AS_GREAT >= atomicLoad(&indexed[at])) {
        atomicMax(&indexed[at + 1u], 0xffffffffu - (page.first + surfel));
    }
}

fn take_small(slot: u32, names: bool) {
    if (slot >= arrayLength(&projected)) {
        return;
    }
    let record = projected[slot];
    let splat = splat_of(record);
    let surfel = surfel_in(record, slot);
    let filter_ = filter_in(record);
    let pixels = reach(splat);
    if (is_large(splat) || hidden(splat, filter_, pixels, radius_of(surfel))) {
        return;
    }
    var at = pixels.first;
    while (at.y <= pixels.last.y) {
        take(splat, filter_, surfel, at.x, at.y, names);
        at.x++;
        at = select(at, vec2<u32>(pixels.first.x, at.y + 1u), at.x > pixels.last.x);
    }
}

fn take_large(place: u32, local: vec2<u32>, names: bool) {
    let slot = large_splat(place);
    if (slot >= arrayLength(&projected)) {
        return;
    }
    let record = projected[slot];
    let splat = splat_of(record);
    let surfel = surfel_in(record, slot);
    let filter_ = filter_in(record);
    let pixels = reach(splat);
    for (var y = pixels.first.y + local.y; y <= pixels.last.y; y += TILE) {
        for (var x = pixels.first.x + local.x; x <= pixels.last.x; x += TILE) {
            take(splat, filter_, surfel, x, y, names);
        }
    }
}

@compute @workgroup_size(WORKGROUP)
fn strongest(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    take_small(slot_of(workgroup, workgroups, local), false);
}

@compute @workgroup_size(TILE, TILE)
fn strongest_large(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    take_large(workgroup.y * workgroups.x + workgroup.x, local.xy, false);
}

@compute @workgroup_size(WORKGROUP)
fn name_strongest(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    take_small(slot_of(workgroup, workgroups, local), true);
}

@compute @workgroup_size(TILE, TILE)
fn name_strongest_large(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    take_large(workgroup.y * workgroups.x + workgroup.x, local.xy, true);
}
