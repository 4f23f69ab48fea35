// Runs between stages 2 and 3 if tiles are drawn: makes, for each cell of the image, a list of the
// splats that may touch the cell. The splats of each cell are counted, a prefix sum turns counts
// into starts, and each splat is written to its place. The cells of small splats are the tiles; the
// cells of large splats, which touch many tiles, are blocks of tiles. The order within a list
// depends on the schedule, but no minimum or sum depends on that order.
// Host side: src/passes/tiles.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xce41422d9aa244b7
// #import covered::{TILE_ROWS, TILE_WIDTH}
// #import cull|cull_absent|cull_twice::{slot_of, surfel_in}
// #import epsilon_*::{radius_of}
// #import filter|lowpass_none::{filter_in}
// #import footprint::{Rectangle, is_large, large_splat, reach}
// #import layout::{Splat, WORKGROUP, held, held_band, hold}
// #import occlusion::{hidden}
// #import project::{LISTED_AT_ONCE, splats}
// #import raster|visibility::{projected}
// #import records::{splat_of}
// #import words|words_long::{words}

// Words 0 and 1 are the greatest lengths so far: of all lists together, and of one list. For cell
// t, word LIST_ENDS + t + 1 is first its count, then the start of its list, and at last the end;
// word LIST_ENDS is 0. The lists follow from lists_start on.
@group(0) @binding(26) var<storage, read_write> lists: array<atomic<u32>>;

const LIST_ENDS: u32 = 2u;

// The side of a large splat's cell, pixels.
const BLOCK_SIDE: u32 = 16u;
const BLOCK_SIZE: vec2<u32> = vec2<u32>(BLOCK_SIDE, BLOCK_SIDE);

// The size of a small splat's cell, which is a tile.
fn tile_size() -> vec2<u32> {
    return vec2<u32>(TILE_WIDTH, TILE_ROWS);
}

// The number of cells of `size` pixels in a row of the image.
fn cells_across(size: vec2<u32>) -> u32 {
    return (held.width + size.x - 1u) / size.x;
}

// The number of cells of `size` pixels in the band.
fn cells_in_band(size: vec2<u32>) -> u32 {
    return cells_across(size) * ((held_band.rows + size.y - 1u) / size.y);
}

// The word at which the lists of cells of `size` pixels start.
fn lists_start(size: vec2<u32>) -> u32 {
    return LIST_ENDS + 1u + cells_in_band(size);
}

// The first and the last cell, by column and row, that contain `pixels`, which must not be empty.
fn cells_of(pixels: Rectangle, size: vec2<u32>) -> Rectangle {
    let top = vec2<u32>(0u, held_band.first_row);
    return Rectangle((pixels.first - top) / size, (pixels.last - top) / size);
}

// Counts the splat in the cells that it touches: in each row of cells, from `offset` on in steps of
// `step`. Once the counts have become starts, a call with `enters` also writes the splat into the
// lists of these cells.
fn list_in_cells(slot: u32, splat: Splat, size: vec2<u32>, offset: u32, step: u32, enters: bool) {
    let pixels = reach(splat);
    if (any(pixels.first > pixels.last)) {
        return;
    }
    let cells = cells_of(pixels, size);
    for (var y = cells.first.y; y <= cells.last.y; y++) {
        for (var x = cells.first.x + offset; x <= cells.last.x; x += step) {
            let at = lists_start(size) + atomicAdd(&lists[LIST_ENDS + 1u + y * cells_across(size) + x], 1u);
            if (enters && at < arrayLength(&lists)) {
                atomicStore(&lists[at], slot);
            }
        }
    }
}

// Each row of the workgroup lists one large splat.
fn list_large(workgroup: vec3<u32>, workgroups: vec3<u32>, local: vec3<u32>, enters: bool) {
    let slot = large_splat((workgroup.y * workgroups.x + workgroup.x) * LISTED_AT_ONCE + local.y);
    if (slot < arrayLength(&projected)) {
        list_in_cells(slot, splat_of(projected[slot]), BLOCK_SIZE, local.x, 8u, enters);
    }
}

// One invocation per splat. A hidden splat gets empty bounds, so that no later pass draws it.
@compute @workgroup_size(WORKGROUP)
fn bin_count(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let slot = slot_of(workgroup, workgroups, local);
    if (slot >= arrayLength(&splats)) {
        return;
    }
    let record = splats[slot];
    let splat = splat_of(record);
    if (is_large(splat)) {
        return;
    }
    if (hidden(splat, filter_in(record), reach(splat), radius_of(surfel_in(record, slot)))) {
        splats[slot][0] = words(vec4<u32>(0u, 0u, 0xffffffffu, 0u));
    } else {
        list_in_cells(slot, splat, tile_size(), 0u, 1u, false);
    }
}

@compute @workgroup_size(WORKGROUP)
fn bin_place(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let slot = slot_of(workgroup, workgroups, local);
    if (slot < arrayLength(&projected)) {
        let splat = splat_of(projected[slot]);
        if (!is_large(splat)) {
            list_in_cells(slot, splat, tile_size(), 0u, 1u, true);
        }
    }
}

@compute @workgroup_size(8, LISTED_AT_ONCE)
fn bin_count_large(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    list_large(workgroup, workgroups, local, false);
}

@compute @workgroup_size(8, LISTED_AT_ONCE)
fn bin_place_large(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    list_large(workgroup, workgroups, local, true);
}

const SCANNERS: u32 = 256u;
var<workgroup> partial: array<u32, SCANNERS>;

// Turns the counts of small splats into starts. One workgroup; each invocation has a range of
// cells.
@compute @workgroup_size(SCANNERS)
fn bin_scan(@builtin(local_invocation_index) local: u32) {
    hold();
    scan(local, cells_in_band(tile_size()));
}

@compute @workgroup_size(SCANNERS)
fn bin_scan_large(@builtin(local_invocation_index) local: u32) {
    hold();
    scan(local, cells_in_band(BLOCK_SIZE));
}

fn scan(local: u32, cells: u32) {
    let run = (cells + SCANNERS - 1u) / SCANNERS;
    let first = LIST_ENDS + 1u + min(local * run, cells);
    let last = LIST_ENDS + 1u + min(local * run + run, cells);
    var total = 0u;
    var longest = 0u;
    for (var t = first; t < last; t++) {
        let count = atomicLoad(&lists[t]);
        longest = max(longest, count);
        total += count;
    }
    atomicMax(&lists[1], longest);
    partial[local] = total;
    workgroupBarrier();
    if (local == 0u) {
        var before = 0u;
        for (var k = 0u; k < SCANNERS; k++) {
            let own = partial[k];
            partial[k] = before;
            before += own;
        }
        atomicMax(&lists[0], before);
    }
    workgroupBarrier();
    var start = partial[local];
    for (var t = first; t < last; t++) {
        let own = atomicLoad(&lists[t]);
        atomicStore(&lists[t], start);
        start += own;
    }
}
