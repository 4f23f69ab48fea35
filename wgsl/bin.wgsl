// Between stages 2 and 3, for tiles: each cell of the image gets a list of the splats that may touch it, by count, scan and
// place. A small splat's cells are the tiles; a large one's are blocks of them, as it touches many. The order within a list
// depends on the schedule, but no minimum or sum does. Host side: src/passes/tiles.rs.

// For cell t, word t + 1 is at first its count, then where its list starts, and at last where it ends; word 0 is 0. The last
// two words say how long all lists together, and the longest, were at most.
@group(0) @binding(26) var<storage, read_write> ends: array<atomic<u32>>;
@group(0) @binding(27) var<storage, read_write> lists: array<u32>;

// Pixels of a tile, across and down.
const TILE_SIDE: u32 = 8u;
// Of a large splat's cell.
const BLOCK_SIDE: u32 = 16u;

// Cells of `side` pixels in a row of the image.
fn cells_across(side: u32) -> u32 {
    return (view.width + side - 1u) / side;
}

// The cells that hold `pixels`, which are some, x and y.
fn cells_of(pixels: Rectangle, side: u32) -> Rectangle {
    let top = vec2<u32>(0u, band.first_row);
    return Rectangle((pixels.first - top) / side, (pixels.last - top) / side);
}

// Counts the splat in its cells, of these those from `offset` on in steps of `step`.
fn count_cells(splat: Splat, side: u32, offset: vec2<u32>, step: u32) {
    let pixels = reach(splat);
    if (any(pixels.first > pixels.last)) {
        return;
    }
    let cells = cells_of(pixels, side);
    for (var y = cells.first.y + offset.y; y <= cells.last.y; y += step) {
        for (var x = cells.first.x + offset.x; x <= cells.last.x; x += step) {
            atomicAdd(&ends[y * cells_across(side) + x + 1u], 1u);
        }
    }
}

// Enters it in their lists.
fn enter_cells(index: u32, splat: Splat, side: u32, offset: vec2<u32>, step: u32) {
    let pixels = reach(splat);
    if (any(pixels.first > pixels.last)) {
        return;
    }
    let cells = cells_of(pixels, side);
    for (var y = cells.first.y + offset.y; y <= cells.last.y; y += step) {
        for (var x = cells.first.x + offset.x; x <= cells.last.x; x += step) {
            let at = atomicAdd(&ends[y * cells_across(side) + x + 1u], 1u);
            if (at < arrayLength(&lists)) {
                lists[at] = index;
            }
        }
    }
}

// One invocation a splat. One that is hidden gets empty bounds, by which no later pass sees it.
@compute @workgroup_size(WORKGROUP)
fn bin_count(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let index = surfel_of(workgroup, workgroups, local);
    if (index >= arrayLength(&splats)) {
        return;
    }
    let splat = splats[index];
    if (is_large(splat)) {
        return;
    }
    if (hidden(splat, filter_of(index), reach(splat), radius_of(index))) {
        splats[index].bounds_first = 0xffffffffu;
        splats[index].bounds_last = 0u;
    } else {
        count_cells(splat, TILE_SIDE, vec2<u32>(0u), 1u);
    }
}

@compute @workgroup_size(WORKGROUP)
fn bin_place(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let index = surfel_of(workgroup, workgroups, local);
    if (index < arrayLength(&projected)) {
        let splat = projected[index];
        if (!is_large(splat)) {
            enter_cells(index, splat, TILE_SIDE, vec2<u32>(0u), 1u);
        }
    }
}

// One workgroup a large splat, in a square of eight invocations.
@compute @workgroup_size(8, 8)
fn bin_count_large(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let index = large_splat(workgroup, workgroups);
    if (index < arrayLength(&projected)) {
        count_cells(projected[index], BLOCK_SIDE, local.xy, 8u);
    }
}

@compute @workgroup_size(8, 8)
fn bin_place_large(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let index = large_splat(workgroup, workgroups);
    if (index < arrayLength(&projected)) {
        enter_cells(index, projected[index], BLOCK_SIDE, local.xy, 8u);
    }
}

const SCANNERS: u32 = 256u;
var<workgroup> partial: array<u32, SCANNERS>;

// Counts become starts. One workgroup; each invocation has a run of cells.
@compute @workgroup_size(SCANNERS)
fn bin_scan(@builtin(local_invocation_index) local: u32) {
    let cells = arrayLength(&ends) - 3u;
    let run = (cells + SCANNERS - 1u) / SCANNERS;
    let first = min(local * run, cells);
    let last = min(first + run, cells);
    var total = 0u;
    var longest = 0u;
    for (var t = first; t < last; t++) {
        let count = atomicLoad(&ends[t + 1u]);
        longest = max(longest, count);
        total += count;
    }
    atomicMax(&ends[arrayLength(&ends) - 1u], longest);
    partial[local] = total;
    workgroupBarrier();
    if (local == 0u) {
        var before = 0u;
        for (var k = 0u; k < SCANNERS; k++) {
            let own = partial[k];
            partial[k] = before;
            before += own;
        }
        atomicMax(&ends[arrayLength(&ends) - 2u], before);
    }
    workgroupBarrier();
    var start = partial[local];
    for (var t = first; t < last; t++) {
        let own = atomicLoad(&ends[t + 1u]);
        atomicStore(&ends[t + 1u], start);
        start += own;
    }
}
