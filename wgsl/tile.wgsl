// Stages 2 to 4 by tiles of the image, whose lists bin.wgsl made. An invocation keeps a column of a tile's pixels in registers,
// eight of them a tile. The footprint, and so every bit, is that of visibility.wgsl and accumulate.wgsl.
// Host side: src/passes/tiles.rs.

// The lists of the large splats.
@group(0) @binding(27) var<storage, read> large_lists: array<u32>;

// The pixels of this invocation, from (x, y) down; `pixel` is the first one's place in the band. Those past the image's edge
// have nothing. `large` and `small`: where its tile's lists start and end.
struct Column {
    x: u32,
    y: u32,
    pixel: u32,
    pixels: u32,
    large: vec2<u32>,
    small: vec2<u32>,
}

// A workgroup has tiles next to each other.
fn column_of(workgroup: vec3<u32>, local: u32) -> Column {
    let x = workgroup.x * WORKGROUP + local;
    let row = workgroup.y * TILE_SIDE;
    var column = Column(x, row + band.first_row, row * view.width + x, 0u, vec2<u32>(0u), vec2<u32>(0u));
    if (x / TILE_SIDE < cells_across(TILE_SIDE)) {
        let end = LIST_ENDS + 1u + row / BLOCK_SIDE * cells_across(BLOCK_SIDE) + x / BLOCK_SIDE;
        let list = vec2<u32>(large_lists[end - 1u], large_lists[end]) + lists_start(BLOCK_SIDE);
        column.large = min(list, vec2<u32>(arrayLength(&large_lists)));
        column.small = small_list(x / TILE_SIDE, workgroup.y);
        column.pixels = select(0u, min(TILE_SIDE, band.rows - row), x < view.width);
    }
    return column;
}

// What this invocation fetched.
var<private> own_index: u32;
var<private> own_splat: Splat;
var<private> own_filter: Filter;

// Fetches of the first `listed` splats, of which the large come first, those from `place` on; a bit for each that could have a
// fragment in the tile no deeper than `deepest`.
fn fetch(place: u32, listed: u32, column: Column, deepest: f32) -> u32 {
    let at = place + fetcher();
    let large = column.large.y - column.large.x;
    var wanted = false;
    if (at < listed) {
        if (at < large) {
            own_index = large_lists[column.large.x + at];
        } else {
            own_index = small_entry(column.small.x + (at - large));
        }
        own_splat = projected[own_index];
        own_filter = filter_of(own_index);
        let extent = reach(own_splat);
        let first = vec2<u32>(column.x / TILE_SIDE * TILE_SIDE, column.y);
        let last = first + TILE_SIDE - 1u;
        let pixels = Rectangle(max(extent.first, first), min(extent.last, last));
        wanted = all(pixels.first <= pixels.last)
            && nearest_reached(own_splat, own_filter, pixels) <= deepest
            && !misses(own_splat, own_filter, pixels);
    }
    return offered(wanted);
}

fn handed_number(number: f32, from_: u32) -> f32 {
    return bitcast<f32>(handed(bitcast<u32>(number), from_));
}

fn handed_row(row: array<f32, 3>, from_: u32) -> array<f32, 3> {
    return array<f32, 3>(
        handed_number(row[0], from_),
        handed_number(row[1], from_),
        handed_number(row[2], from_),
    );
}

// What the footprint is made of.
fn handed_splat(from_: u32) -> Splat {
    var splat: Splat;
    splat.anchor_x = bitcast<i32>(handed(bitcast<u32>(own_splat.anchor_x), from_));
    splat.anchor_y = bitcast<i32>(handed(bitcast<u32>(own_splat.anchor_y), from_));
    splat.a = handed_row(own_splat.a, from_);
    splat.b = handed_row(own_splat.b, from_);
    splat.c = handed_row(own_splat.c, from_);
    splat.a_low = handed_row(own_splat.a_low, from_);
    return splat;
}

fn handed_attributes(own: Attributes, from_: u32) -> Attributes {
    let c = own.color;
    let n = own.normal;
    return attributes_without_place(
        vec4<f32>(
            handed_number(c.x, from_),
            handed_number(c.y, from_),
            handed_number(c.z, from_),
            handed_number(c.w, from_),
        ),
        vec3<f32>(handed_number(n.x, from_), handed_number(n.y, from_), handed_number(n.z, from_)),
        handed_number(own.radius, from_),
    );
}

fn nearer(front: f32, splat: Splat, filter_: Filter, x: u32, y: u32) -> f32 {
    let fragment = footprint(splat, filter_, x, y);
    return select(front, min(front, fragment.depth), fragment.hit);
}

fn farthest_of(a: vec4<f32>, b: vec4<f32>) -> f32 {
    let m = max(a, b);
    return farthest_in_tile(max(max(m.x, m.y), max(m.z, m.w)));
}

@compute @workgroup_size(WORKGROUP)
fn tile_visibility(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    hold_lane();
    let column = column_of(workgroup, local);
    let listed = column.large.y - column.large.x;
    if (listed == 0u) {
        return;
    }
    // Pixels past the edge are as near as can be.
    var a = vec4<f32>(0.0);
    var b = vec4<f32>(0.0);
    for (var k = 0u; k < 4u; k++) {
        if (k < column.pixels) {
            a[k] = bitcast<f32>(atomicLoad(&nearest[column.pixel + k * view.width]));
        }
        if (k + 4u < column.pixels) {
            b[k] = bitcast<f32>(atomicLoad(&nearest[column.pixel + (k + 4u) * view.width]));
        }
    }
    for (var place = 0u; place < listed; place += FETCHED) {
        var wanted = fetch(place, listed, column, farthest_of(a, b));
        while (wanted != 0u) {
            let next = firstTrailingBit(wanted);
            wanted &= wanted - 1u;
            let splat = handed_splat(next);
            let filter_ = handed_filter(own_filter, next);
            a.x = nearer(a.x, splat, filter_, column.x, column.y);
            a.y = nearer(a.y, splat, filter_, column.x, column.y + 1u);
            a.z = nearer(a.z, splat, filter_, column.x, column.y + 2u);
            a.w = nearer(a.w, splat, filter_, column.x, column.y + 3u);
            b.x = nearer(b.x, splat, filter_, column.x, column.y + 4u);
            b.y = nearer(b.y, splat, filter_, column.x, column.y + 5u);
            b.z = nearer(b.z, splat, filter_, column.x, column.y + 6u);
            b.w = nearer(b.w, splat, filter_, column.x, column.y + 7u);
        }
    }
    for (var k = 0u; k < 4u; k++) {
        if (k < column.pixels) {
            atomicStore(&nearest[column.pixel + k * view.width], bitcast<u32>(a[k]));
        }
        if (k + 4u < column.pixels) {
            atomicStore(&nearest[column.pixel + (k + 4u) * view.width], bitcast<u32>(b[k]));
        }
    }
}

// A pixel without anything is 0, which no fragment is within epsilon of.
fn front_of(column: Column, k: u32) -> f32 {
    if (k >= column.pixels) {
        return 0.0;
    }
    let front = front_at(column.pixel + k * view.width);
    return select(front, 0.0, bitcast<u32>(front) == NOTHING);
}

fn gather(slot: u32, splat: Splat, filter_: Filter, attributes: Attributes, front: f32, column: Column) {
    let fragment = footprint(splat, filter_, column.x, column.y + slot);
    // Selected, as a branch would select what is stored of each sum.
    let accepted = fragment.hit && fragment.depth <= farthest_accepted(front, attributes.radius);
    let weight = select(Term(0), weight_of(fragment), accepted);
    blend_weighted(slot, weight, select(front, fragment.depth, accepted), front, attributes);
}

// Sums the fragments of the tile's splats in registers.
fn sum_tile(column: Column) {
    let a = vec4<f32>(front_of(column, 0u), front_of(column, 1u), front_of(column, 2u), front_of(column, 3u));
    let b = vec4<f32>(front_of(column, 4u), front_of(column, 5u), front_of(column, 6u), front_of(column, 7u));
    let deepest = deepest_accepted(farthest_of(a, b));
    let listed = (column.large.y - column.large.x) + (column.small.y - column.small.x);
    for (var place = 0u; place < listed; place += FETCHED) {
        var wanted = fetch(place, listed, column, deepest);
        let own_attributes = attributes_of(own_index, own_splat);
        while (wanted != 0u) {
            let next = firstTrailingBit(wanted);
            wanted &= wanted - 1u;
            let splat = handed_splat(next);
            let filter_ = handed_filter(own_filter, next);
            let attributes = handed_attributes(own_attributes, next);
            gather(0u, splat, filter_, attributes, a.x, column);
            gather(1u, splat, filter_, attributes, a.y, column);
            gather(2u, splat, filter_, attributes, a.z, column);
            gather(3u, splat, filter_, attributes, a.w, column);
            gather(4u, splat, filter_, attributes, b.x, column);
            gather(5u, splat, filter_, attributes, b.y, column);
            gather(6u, splat, filter_, attributes, b.z, column);
            gather(7u, splat, filter_, attributes, b.w, column);
        }
    }
}

// Adds what the splats of this page and of some sizes sum to.
@compute @workgroup_size(WORKGROUP)
fn tile_accumulate(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    hold_lane();
    let column = column_of(workgroup, local);
    if (column.large.x == column.large.y) {
        return;
    }
    sum_tile(column);
    for (var k = 0u; k < column.pixels; k++) {
        show(k);
        deposit(column.pixel + k * view.width);
    }
}

// Where the tiles have all splats there are, their sums need not be stored.
@compute @workgroup_size(WORKGROUP)
fn tile_resolve(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    hold_lane();
    let column = column_of(workgroup, local);
    sum_tile(column);
    for (var k = 0u; k < column.pixels; k++) {
        show(k);
        resolve_pixel(k, column.pixel + k * view.width, column.x, column.y + k);
    }
}
