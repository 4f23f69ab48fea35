// Stages 2 to 4 by tiles of the image on a graphics card, from the lists that bin.wgsl made. Each
// tile has 16x16 pixels, and each of its invocations draws one of them. They look at 256 splats of
// the lists at once, and copy those that reach the tile into workgroup memory, from where all of
// them draw these splats. Every bit of the result is that of visibility.wgsl and accumulate.wgsl.
// Kernels set the workgroup memory of this file before they read it.
// Same interface as tile.wgsl. Host side: src/passes/tiles.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xf5a32725221354f2
// #import *::{resolve_column, show}
// #import accumulator_raster|visibility::{nearest}
// #import blend|winner::{Attributes, attributes_of}
// #import column::{Column, all_listed, column_at, front_of, gather, large_listed, listed_slot}
// #import covered::{covered_tile, tiles_across}
// #import cull|cull_absent|cull_twice::{surfel_in}
// #import epsilon_*::{deepest_accepted}
// #import fade::{takes_sample}
// #import filter|lowpass_none::{Filter, filter_in}
// #import footprint::{footprint}
// #import layout::{Splat, hold, kept_depth}
// #import raster|visibility::{projected}
// #import records::{splat_of}
// #import staged_sums|tile_sums::{deposit}
// #import tile_reach::{reaches}

const SIDE: u32 = 16u;
const PIXELS: u32 = SIDE * SIDE;

// Splats that workgroup memory holds at a time. With all that a splat can have, and with samples
// (staged_samples.wgsl), a workgroup takes 15.5 of the 16 KiB that core WebGPU grants.
const STAGED: u32 = 32u;

// The slots of the splats that were found to reach the tile, and their number.
var<workgroup> found: array<u32, PIXELS>;
var<workgroup> found_so_far: atomic<u32>;
var<workgroup> found_count: u32;
// The bits of the farthest depth that may still show in the tile.
var<workgroup> farthest_bits: atomic<u32>;
var<workgroup> farthest: f32;
// The length of the lists; the same in all invocations of the tile.
var<workgroup> listed_length: u32;
var<workgroup> staged_splats: array<Splat, STAGED>;
var<workgroup> staged_filters: array<Filter, STAGED>;
var<workgroup> staged_attributes: array<Attributes, STAGED>;

fn pixel_of(tile: u32, local: u32) -> Column {
    let first = vec2<u32>(tile % tiles_across(), tile / tiles_across()) * SIDE;
    return column_at(tile, first.x + local % SIDE, first.y + local / SIDE, 1u);
}

// A number that the first invocation has, for all of them.
fn length_for_all(length: u32, local: u32) -> u32 {
    if (local == 0u) {
        listed_length = length;
    }
    return workgroupUniformLoad(&listed_length);
}

// The greatest of the depths of all invocations, which are not negative.
fn farthest_of_all(depth: f32, local: u32) -> f32 {
    if (local == 0u) {
        atomicStore(&farthest_bits, 0u);
    }
    workgroupBarrier();
    atomicMax(&farthest_bits, bitcast<u32>(depth));
    workgroupBarrier();
    if (local == 0u) {
        farthest = bitcast<f32>(atomicLoad(&farthest_bits));
    }
    return workgroupUniformLoad(&farthest);
}

// Finds the splats that may have a fragment in the tile no deeper than `deepest`, among the PIXELS
// splats of the lists from `place` on, and returns their number.
fn find(place: u32, listed: u32, column: Column, deepest: f32, local: u32) -> u32 {
    if (local == 0u) {
        atomicStore(&found_so_far, 0u);
    }
    workgroupBarrier();
    if (place + local < listed) {
        let slot = listed_slot(column, place + local);
        let record = projected[slot];
        let first = vec2<u32>(column.x - local % SIDE, column.y - local / SIDE);
        if (reaches(splat_of(record), filter_in(record), first, SIDE, deepest)) {
            found[atomicAdd(&found_so_far, 1u)] = slot;
        }
    }
    workgroupBarrier();
    if (local == 0u) {
        found_count = atomicLoad(&found_so_far);
    }
    return workgroupUniformLoad(&found_count);
}

// Copies the found splats from `first` on to workgroup memory, and returns how many there are.
fn stage(first: u32, count: u32, local: u32, with_attributes: bool) -> u32 {
    // The splats before them have been drawn.
    workgroupBarrier();
    if (local < STAGED && first + local < count) {
        let slot = found[first + local];
        let record = projected[slot];
        let splat = splat_of(record);
        staged_splats[local] = splat;
        staged_filters[local] = filter_in(record);
        if (with_attributes) {
            staged_attributes[local] = attributes_of(surfel_in(record, slot), splat);
        }
    }
    workgroupBarrier();
    return min(count - first, STAGED);
}

@compute @workgroup_size(PIXELS)
fn tile_visibility(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let column = pixel_of(workgroup.y * workgroups.x + workgroup.x, local);
    let listed = length_for_all(large_listed(column), local);
    if (listed == 0u) {
        return;
    }
    // Pixels past the edge of the image are 0, the nearest possible depth.
    var front = 0.0;
    if (column.pixels > 0u) {
        front = bitcast<f32>(kept_depth(atomicLoad(&nearest[column.pixel])));
    }
    for (var place = 0u; place < listed; place += PIXELS) {
        let count = find(place, listed, column, farthest_of_all(front, local), local);
        for (var first = 0u; first < count; first += STAGED) {
            let staged = stage(first, count, local, false);
            for (var k = 0u; k < staged; k++) {
                let splat = staged_splats[k];
                let fragment = footprint(splat, staged_filters[k], column.x, column.y);
                if (fragment.hit && takes_sample(splat.fade, column.x, column.y)) {
                    front = min(front, fragment.depth);
                }
            }
        }
    }
    if (column.pixels > 0u) {
        atomicStore(&nearest[column.pixel], kept_depth(bitcast<u32>(front)));
    }
}

// Sums the fragments of the first `listed` splats of the tile's lists.
fn sum_pixel(listed: u32, column: Column, local: u32) {
    let front = front_of(column, 0u);
    let deepest = deepest_accepted(farthest_of_all(front, local));
    for (var place = 0u; place < listed; place += PIXELS) {
        let count = find(place, listed, column, deepest, local);
        for (var first = 0u; first < count; first += STAGED) {
            let staged = stage(first, count, local, true);
            for (var k = 0u; k < staged; k++) {
                gather(0u, staged_splats[k], staged_filters[k], staged_attributes[k], front, column);
            }
        }
    }
}

// Adds the sums of the listed splats of this page to those in storage.
@compute @workgroup_size(PIXELS)
fn tile_accumulate(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let column = pixel_of(workgroup.y * workgroups.x + workgroup.x, local);
    let listed = length_for_all(all_listed(column), local);
    if (listed == 0u) {
        return;
    }
    sum_pixel(listed, column, local);
    if (column.pixels > 0u) {
        show(0u);
        deposit(column.pixel);
    }
}

// Sums and resolves at once, without storing the sums. Used where the tiles' lists contain all
// splats; runs over covered tiles only.
@compute @workgroup_size(PIXELS)
fn tile_resolve(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let column = pixel_of(covered_tile(workgroup.y * workgroups.x + workgroup.x), local);
    sum_pixel(length_for_all(all_listed(column), local), column, local);
    resolve_column(column, local);
}
