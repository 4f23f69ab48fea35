// Stage 3 for small splats on a graphics card. A workgroup draws the splats of some batches, which
// are neighbours in most cases. It spreads their pixels evenly over its invocations, so that none
// waits for another with a larger splat, and sums them in its memory (sums_window.wgsl).
// Same interface as accumulate_alone.wgsl.
// Kernels set the workgroup memory of this file before they read it.
// All loops end, by 1, 5 of src/gpu/loops.rs: 0x00f79b0ab65f1a01
// #import *::{front_at}
// #import blend|winner::{Attributes, attributes_of}
// #import blend|winner_second::{blend}
// #import cull|cull_absent|cull_twice::{surfel_in}
// #import epsilon_*::{radius_of}
// #import filter|lowpass_none::{filter_in}
// #import footprint::{footprint, is_large, pixel_index, reach}
// #import layout::{WORKGROUP, hold, linear_index}
// #import occlusion::{hidden}
// #import raster|visibility::{projected}
// #import records::{splat_of}
// #import side::{is_shown}
// #import sums_window::{BLOCK_PIXELS, MOST_BLOCKS, WINDOW, WINDOW_BLOCK, WINDOW_WORDS, claim_block}
// #import sums_window::{flush, place_in_window, window, window_owners, window_place}

// The invocations of a workgroup, and its splats: a multiple of WORKGROUP, and no more than
// invocations. The attributes of WORKGROUP splats are in its memory at a time.
const SPREAD: u32 = 256u;
override SPREAD_SPLATS: u32;
var<workgroup> spread_attributes: array<Attributes, WORKGROUP>;
// The number of pixels of the splats up to and including each one.
var<workgroup> pixel_ends: array<u32, SPREAD>;

fn clear_owners(local: u32) {
    for (var block = local; block < MOST_BLOCKS; block += SPREAD) {
        atomicStore(&window_owners[block], 0u);
    }
}

// A barrier must follow.
fn clear_window(local: u32) {
    for (var word = local; word < WINDOW_WORDS; word += SPREAD) {
        atomicStore(&window[word], 0u);
    }
}

// Replaces the numbers in pixel_ends by the sums of all numbers up to and including each one.
fn sum_ends(local: u32) {
    for (var step = 1u; step < SPREAD; step += step) {
        workgroupBarrier();
        var before = 0u;
        if (local >= step) {
            before = pixel_ends[local - step];
        }
        workgroupBarrier();
        pixel_ends[local] += before;
    }
}

// The number of pixels of the splats before one.
fn pixels_before(local: u32) -> u32 {
    var count = 0u;
    if (local > 0u) {
        count = pixel_ends[local - 1u];
    }
    return count;
}

// The splat that has a pixel, which is one of WORKGROUP splats from `first` on: those before it
// are the splats whose pixels end no later.
fn splat_with(pixel: u32, first: u32) -> u32 {
    var splat = first;
    for (var half = WORKGROUP / 2u; half > 0u; half /= 2u) {
        splat += select(0u, half, pixel_ends[splat + half - 1u] <= pixel);
    }
    return splat;
}

// The number of pixels that the splat of a slot may show in; claims their places.
fn prepared(slot: u32) -> u32 {
    let record = projected[slot];
    let splat = splat_of(record);
    let pixels = reach(splat);
    if (is_large(splat) || hidden(splat, filter_in(record), pixels, radius_of(surfel_in(record, slot)))) {
        return 0u;
    }
    let last = pixels.last / WINDOW_BLOCK;
    for (var y = pixels.first.y / WINDOW_BLOCK; y <= last.y; y++) {
        for (var x = pixels.first.x / WINDOW_BLOCK; x <= last.x; x++) {
            claim_block(vec2<u32>(x, y));
        }
    }
    let size = pixels.last - pixels.first + 1u;
    return size.x * size.y;
}

// Adds a pixel of a splat, counted from the splat's first pixel, to the window or to the image.
fn accumulate_pixel(slot: u32, staged: u32, offset: u32) {
    let record = projected[slot];
    let splat = splat_of(record);
    let pixels = reach(splat);
    let width = pixels.last.x - pixels.first.x + 1u;
    let at = pixels.first + vec2<u32>(offset % width, offset / width);
    let fragment = footprint(splat, filter_in(record), at.x, at.y);
    if (!fragment.hit) {
        return;
    }
    let pixel = pixel_index(at.x, at.y);
    let front = front_at(pixel);
    if (is_shown(fragment, front, spread_attributes[staged].radius, at)) {
        window_place = place_in_window(at);
        blend(pixel, fragment, front, spread_attributes[staged]);
    }
}

// Adds the pixels of WORKGROUP splats. `slot` is that of the workgroup's first splat, and `first`
// the number of the first of these splats.
fn accumulate_splats(slot: u32, first: u32, local: u32) {
    let own = local - first;
    if (own < WORKGROUP && pixel_ends[local] > pixels_before(local)) {
        let record = projected[slot + local];
        spread_attributes[own] = attributes_of(surfel_in(record, slot + local), splat_of(record));
    }
    workgroupBarrier();
    let end = pixel_ends[first + WORKGROUP - 1u];
    for (var pixel = pixels_before(first) + local; pixel < end; pixel += SPREAD) {
        let splat = splat_with(pixel, first);
        accumulate_pixel(slot + splat, splat - first, pixel - pixels_before(splat));
    }
    workgroupBarrier();
}

// The grid has a workgroup for each WORKGROUP slots; most of them have nothing to do.
@compute @workgroup_size(SPREAD)
fn accumulate(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let slot = linear_index(workgroup, workgroups, 0u);
    if (slot % SPREAD_SPLATS != 0u) {
        return;
    }
    let end = min(arrayLength(&projected), workgroups.x * workgroups.y * WORKGROUP);
    clear_owners(local);
    workgroupBarrier();
    var count = 0u;
    if (local < SPREAD_SPLATS && slot + local < end) {
        count = prepared(slot + local);
    }
    pixel_ends[local] = count;
    sum_ends(local);
    if (workgroupUniformLoad(&pixel_ends[SPREAD - 1u]) == 0u) {
        return;
    }
    clear_window(local);
    for (var first = 0u; first < SPREAD_SPLATS; first += WORKGROUP) {
        accumulate_splats(slot, first, local);
    }
    for (var place = local; place < WINDOW * BLOCK_PIXELS; place += SPREAD) {
        flush(place);
    }
}
