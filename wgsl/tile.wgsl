// Stages 2 and 3 for large splats: they are binned into tiles of the image, and each tile is drawn by one workgroup, whose
// invocations keep a row of eight pixels each in registers. The footprint, and so every bit, is that of visibility.wgsl and
// accumulate.wgsl. Host side: src/passes/tiles.rs.
//
// Binning is count, scan and place. The order within a tile's list depends on the schedule, but no minimum or sum does.

// For tile t, word t + 1 is at first its count, then where its list starts, and at last where it ends; word 0 is 0. The last
// two words say how long all lists together, and the longest, were at most.
@group(0) @binding(26) var<storage, read_write> ends: array<atomic<u32>>;
@group(0) @binding(27) var<storage, read_write> lists: array<u32>;
@group(0) @binding(28) var<storage, read> listed_ends: array<u32>;
@group(0) @binding(29) var<storage, read> tile_lists: array<u32>;
// The large splats of the page, in the order of the queue.
@group(0) @binding(31) var<storage, read_write> larges: array<Splat>;
@group(0) @binding(32) var<storage, read_write> attributes_of_larges: array<LargeAttributes>;

const TILE_WIDTH: u32 = 32u;
const TILE_HEIGHT: u32 = 16u;
// A tile is four by two blocks of eight by eight pixels, a block eight invocations.
const BLOCK: u32 = 8u;
// An entry of a list is a splat's place in the queue of large ones, and a bit for each block that it may touch.
const ENTRY_BITS: u32 = 24u;
const ENTRY_PLACE: u32 = 0xffffffu;

fn tiles_across() -> u32 {
    return (view.width + TILE_WIDTH - 1u) / TILE_WIDTH;
}

fn tile_count_of_band() -> u32 {
    return tiles_across() * ((band.rows + TILE_HEIGHT - 1u) / TILE_HEIGHT);
}

// The tiles that the large splat of this invocation may touch, x and y; empty if there is no such splat.
fn touched(index: u32) -> Rectangle {
    if (index >= arrayLength(&projected)) {
        return Rectangle(vec2<u32>(1u), vec2<u32>(0u));
    }
    let pixels = reach(projected[index]);
    if (any(pixels.first > pixels.last)) {
        return Rectangle(vec2<u32>(1u), vec2<u32>(0u));
    }
    let size = vec2<u32>(TILE_WIDTH, TILE_HEIGHT);
    let top = vec2<u32>(0u, band.first_row);
    return Rectangle((pixels.first - top) / size, (pixels.last - top) / size);
}

// The splat at a place of the queue, or none (a number that is no index).
fn queued_splat(place: u32) -> u32 {
    if (place >= queued[0]) {
        return 0xffffffffu;
    }
    return queued[QUEUE_START + place];
}

@compute @workgroup_size(WORKGROUP)
fn tile_count(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let tiles = touched(queued_splat(linear_index(workgroup, workgroups, local)));
    for (var y = tiles.first.y; y <= tiles.last.y; y++) {
        for (var x = tiles.first.x; x <= tiles.last.x; x++) {
            atomicAdd(&ends[y * tiles_across() + x + 1u], 1u);
        }
    }
}

const SCANNERS: u32 = 256u;
var<workgroup> partial: array<u32, SCANNERS>;

// Counts become starts. One workgroup; each invocation has a run of tiles.
@compute @workgroup_size(SCANNERS)
fn tile_scan(@builtin(local_invocation_index) local: u32) {
    let tiles = tile_count_of_band();
    let run = (tiles + SCANNERS - 1u) / SCANNERS;
    let first = min(local * run, tiles);
    let last = min(first + run, tiles);
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

// The blocks of the tile that lie in `pixels`, relative to the tile's first pixel.
fn blocks_in(first: vec2<i32>, last: vec2<i32>) -> u32 {
    let low = vec2<u32>(max(first, vec2<i32>(0))) / BLOCK;
    let high = vec2<u32>(min(last, vec2<i32>(31, 15))) / BLOCK;
    let across = (0xfu << low.x) & (0xfu >> (3u - high.x));
    return select(0u, across, low.y == 0u) | select(0u, across << 4u, high.y == 1u);
}

@compute @workgroup_size(WORKGROUP)
fn tile_place(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let place = linear_index(workgroup, workgroups, local);
    let index = queued_splat(place);
    let tiles = touched(index);
    if (any(tiles.first > tiles.last) || place >= arrayLength(&larges)) {
        return;
    }
    let splat = projected[index];
    let attributes = attributes_of(index, splat);
    let n = attributes.normal;
    let c = attributes.color;
    larges[place] = splat;
    attributes_of_larges[place] =
        LargeAttributes(array<f32, 4>(c.x, c.y, c.z, c.w), array<f32, 3>(n.x, n.y, n.z), attributes.radius);
    let pixels = reach(splat);
    let top = vec2<i32>(0, i32(band.first_row));
    for (var y = tiles.first.y; y <= tiles.last.y; y++) {
        for (var x = tiles.first.x; x <= tiles.last.x; x++) {
            let corner = vec2<i32>(i32(x * TILE_WIDTH), i32(y * TILE_HEIGHT)) + top;
            let blocks = blocks_in(vec2<i32>(pixels.first) - corner, vec2<i32>(pixels.last) - corner);
            let slot = atomicAdd(&ends[y * tiles_across() + x + 1u], 1u);
            if (slot < arrayLength(&lists)) {
                lists[slot] = (blocks << ENTRY_BITS) | place;
            }
        }
    }
}

// The row of an invocation: its first pixel, how many of its eight lie in the band, and its block's bit in an entry.
struct Row {
    x: u32,
    y: u32,
    pixel: u32,
    pixels: u32,
    block: u32,
}

fn row_of(workgroup: vec3<u32>, local: u32) -> Row {
    let block = local / BLOCK;
    let x = workgroup.x * TILE_WIDTH + (block % 4u) * BLOCK;
    let y = workgroup.y * TILE_HEIGHT + (block / 4u) * BLOCK + local % BLOCK;
    let inside = y < band.rows && x < view.width;
    let pixels = select(0u, min(BLOCK, view.width - x), inside);
    return Row(x, y + band.first_row, y * view.width + x, pixels, 1u << (ENTRY_BITS + block));
}

fn list_of(workgroup: vec3<u32>) -> vec2<u32> {
    let tile = workgroup.y * tiles_across() + workgroup.x;
    return min(vec2<u32>(listed_ends[tile], listed_ends[tile + 1u]), vec2<u32>(arrayLength(&tile_lists)));
}

struct Entry {
    found: bool,
    place: u32,
    splat: Splat,
    filter_: Filter,
}

// The next entry from `place` on, of those before `end`, that could have a fragment in the row no deeper than `deepest`; and
// the place after it. Some drivers skip what no invocation wants by the rounds of a loop only, so this is one.
fn next_entry(place: ptr<function, u32>, end: u32, row: Row, local: u32, deepest: f32) -> Entry {
    let pixels = Rectangle(vec2<u32>(row.x, row.y), vec2<u32>(row.x + row.pixels - 1u, row.y));
    var entry: Entry;
    while (*place < end && !entry.found) {
        let listed = tile_lists[*place];
        *place += 1u;
        if ((listed & row.block) != 0u) {
            entry.place = listed & ENTRY_PLACE;
            entry.splat = shared_splat(entry.place, local);
            entry.filter_ = filter_at(entry.place);
            let reached = nearest_reached(entry.splat, entry.filter_, pixels);
            entry.found = shared_any(row.pixels > 0u && reached <= deepest);
        }
    }
    return entry;
}

fn filter_at(place: u32) -> Filter {
    if (FILTERED) {
        return filter_of(queued[QUEUE_START + place]);
    }
    return filter_of(0u);
}

fn nearer(front: f32, splat: Splat, filter_: Filter, x: u32, y: u32) -> f32 {
    let fragment = footprint(splat, filter_, x, y);
    return select(front, min(front, fragment.depth), fragment.hit);
}

fn farthest_of(a: vec4<f32>, b: vec4<f32>) -> f32 {
    let m = max(a, b);
    return max(max(m.x, m.y), max(m.z, m.w));
}

@compute @workgroup_size(WORKGROUP)
fn tile_visibility(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let list = list_of(workgroup);
    if (list.x == list.y) {
        return;
    }
    let row = row_of(workgroup, local);
    var a = vec4<f32>(0.0);
    var b = vec4<f32>(0.0);
    for (var k = 0u; k < 4u; k++) {
        if (k < row.pixels) {
            a[k] = bitcast<f32>(atomicLoad(&nearest[row.pixel + k]));
        }
        if (k + 4u < row.pixels) {
            b[k] = bitcast<f32>(atomicLoad(&nearest[row.pixel + k + 4u]));
        }
    }
    var place = list.x;
    var found = false;
    loop {
        let next = next_entry(&place, list.y, row, local, farthest_of(a, b));
        if (!next.found) {
            break;
        }
        found = true;
        a.x = nearer(a.x, next.splat, next.filter_, row.x, row.y);
        a.y = nearer(a.y, next.splat, next.filter_, row.x + 1u, row.y);
        a.z = nearer(a.z, next.splat, next.filter_, row.x + 2u, row.y);
        a.w = nearer(a.w, next.splat, next.filter_, row.x + 3u, row.y);
        b.x = nearer(b.x, next.splat, next.filter_, row.x + 4u, row.y);
        b.y = nearer(b.y, next.splat, next.filter_, row.x + 5u, row.y);
        b.z = nearer(b.z, next.splat, next.filter_, row.x + 6u, row.y);
        b.w = nearer(b.w, next.splat, next.filter_, row.x + 7u, row.y);
    }
    if (!found) {
        return;
    }
    for (var k = 0u; k < 4u; k++) {
        if (k < row.pixels) {
            atomicStore(&nearest[row.pixel + k], bitcast<u32>(a[k]));
        }
        if (k + 4u < row.pixels) {
            atomicStore(&nearest[row.pixel + k + 4u], bitcast<u32>(b[k]));
        }
    }
}

// A pixel without anything is 0, which no fragment is within epsilon of.
fn front_of(row: Row, k: u32) -> f32 {
    if (k >= row.pixels) {
        return 0.0;
    }
    let front = front_at(row.pixel + k);
    return select(front, 0.0, bitcast<u32>(front) == NOTHING);
}

fn gather(slot: u32, entry: Entry, attributes: Attributes, front: f32, x: u32, y: u32) {
    let fragment = footprint(entry.splat, entry.filter_, x, y);
    if (fragment.hit && fragment.depth <= farthest_accepted(front, attributes.radius)) {
        blend(slot, fragment, front, attributes);
    }
}

@compute @workgroup_size(WORKGROUP)
fn tile_accumulate(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let list = list_of(workgroup);
    if (list.x == list.y) {
        return;
    }
    let row = row_of(workgroup, local);
    let a = vec4<f32>(front_of(row, 0u), front_of(row, 1u), front_of(row, 2u), front_of(row, 3u));
    let b = vec4<f32>(front_of(row, 4u), front_of(row, 5u), front_of(row, 6u), front_of(row, 7u));
    let farthest = farthest_of(a, b);
    var place = list.x;
    var found = false;
    loop {
        let next = next_entry(&place, list.y, row, local, deepest_accepted(farthest));
        if (!next.found) {
            break;
        }
        found = true;
        let attributes = shared_attributes(next.place, local);
        gather(0u, next, attributes, a.x, row.x, row.y);
        gather(1u, next, attributes, a.y, row.x + 1u, row.y);
        gather(2u, next, attributes, a.z, row.x + 2u, row.y);
        gather(3u, next, attributes, a.w, row.x + 3u, row.y);
        gather(4u, next, attributes, b.x, row.x + 4u, row.y);
        gather(5u, next, attributes, b.y, row.x + 5u, row.y);
        gather(6u, next, attributes, b.z, row.x + 6u, row.y);
        gather(7u, next, attributes, b.w, row.x + 7u, row.y);
    }
    if (!found) {
        return;
    }
    if (row.pixels > 0u) { deposit(0u, row.pixel); }
    if (row.pixels > 1u) { deposit(1u, row.pixel + 1u); }
    if (row.pixels > 2u) { deposit(2u, row.pixel + 2u); }
    if (row.pixels > 3u) { deposit(3u, row.pixel + 3u); }
    if (row.pixels > 4u) { deposit(4u, row.pixel + 4u); }
    if (row.pixels > 5u) { deposit(5u, row.pixel + 5u); }
    if (row.pixels > 6u) { deposit(6u, row.pixel + 6u); }
    if (row.pixels > 7u) { deposit(7u, row.pixel + 7u); }
}
