// Stages 2 to 4 by tiles of the image on a processor, from the lists that bin.wgsl made. Each tile
// has eight invocations, and each of them keeps one column of the tile's pixels in registers.
// Fetching a splat costs as much as drawing its pixels, so tiles are twice as high as wide; the
// upper and the lower eight rows are drawn separately, each half with the splats that reach it.
// Every bit of the result is that of visibility.wgsl and accumulate.wgsl.
// Same interface as staged.wgsl. Host side: src/passes/tiles.rs.
// All loops end, by 1, 3 of src/gpu/loops.rs: 0xa5d29f85787a0471
// #import *::{resolve_column, show}
// #import accumulator_raster|visibility::{nearest}
// #import blend|winner::{Attributes, attributes_of}
// #import column::{Column, all_listed, column_at, front_of, gather, large_listed, listed_slot}
// #import covered::{TILE_ROWS, TILE_WIDTH, covered_tile, tiles_across}
// #import cull|cull_absent|cull_twice::{surfel_in}
// #import epsilon_*::{deepest_accepted}
// #import fade::{takes_sample}
// #import filter|lowpass_none::{Filter, filter_in}
// #import footprint::{footprint}
// #import hand_*::{handed_bend, handed_cap, handed_place, handed_side}
// #import hand_clip::{handed_clip}
// #import hand_fade::{handed_fade}
// #import hand_filter::{handed_filter}
// #import layout::{Splat, WORKGROUP, held, hold, kept_depth, linear_index}
// #import raster|visibility::{projected}
// #import records::{splat_of}
// #import splat_*::{FETCHED, farthest_in_tile, fetcher, handed, hold_lane, offered}
// #import staged_sums|tile_sums::{deposit}
// #import tile_reach::{reaches}

// The column of `tile` that invocation `local` draws: a workgroup has eight tiles, of eight
// invocations each.
fn column_of(tile: u32, local: u32) -> Column {
    let x = tile % tiles_across() * TILE_WIDTH + local % TILE_WIDTH;
    return column_at(tile, x, tile / tiles_across() * TILE_ROWS, TILE_ROWS);
}

// The column of this invocation in a dispatch over all tiles.
fn column_of_all(workgroup: vec3<u32>, workgroups: vec3<u32>, local: u32) -> Column {
    return column_of(linear_index(workgroup, workgroups, local) / TILE_WIDTH, local);
}

// The splat that this invocation has fetched.
var<private> own_surfel: u32;
var<private> own_splat: Splat;
var<private> own_filter: Filter;

// Fetches the splats from `place` on, of the tile's `listed` splats, among which the large ones
// come first. Returns, for the upper and the lower half of the tile, a bit for each fetched splat
// that may have a fragment no deeper than `deepest`.
fn fetch(place: u32, listed: u32, column: Column, deepest: vec2<f32>) -> vec2<u32> {
    let at = place + fetcher();
    let first = vec2<u32>(column.x / TILE_WIDTH * TILE_WIDTH, column.y);
    var wanted = vec2<bool>(false);
    if (at < listed) {
        let slot = listed_slot(column, at);
        let record = projected[slot];
        own_surfel = surfel_in(record, slot);
        own_splat = splat_of(record);
        own_filter = filter_in(record);
        wanted.x = reaches(own_splat, own_filter, first, 8u, deepest.x);
        wanted.y = TILE_ROWS > 8u && reaches(own_splat, own_filter, first + vec2<u32>(0u, 8u), 8u, deepest.y);
    }
    return vec2<u32>(offered(wanted.x), offered(wanted.y));
}

fn handed_number(number: f32, from_: u32) -> f32 {
    return bitcast<f32>(handed(bitcast<u32>(number), from_));
}

fn handed_vector(own: vec3<f32>, from_: u32) -> vec3<f32> {
    return vec3<f32>(handed_number(own.x, from_), handed_number(own.y, from_), handed_number(own.z, from_));
}

fn handed_row(row: array<f32, 3>, from_: u32) -> array<f32, 3> {
    return array<f32, 3>(
        handed_number(row[0], from_),
        handed_number(row[1], from_),
        handed_number(row[2], from_),
    );
}

// The parts of a splat that the footprint needs. A constructor needs every field, so none can be
// forgotten.
fn handed_splat(from_: u32) -> Splat {
    return Splat(
        bitcast<i32>(handed(bitcast<u32>(own_splat.anchor_x), from_)),
        bitcast<i32>(handed(bitcast<u32>(own_splat.anchor_y), from_)),
        // Only the invocation that fetched the splat looks at its bounds, in reaches().
        0u,
        handed_side(own_splat.bounds_last, from_),
        handed_row(own_splat.a, from_),
        handed_row(own_splat.b, from_),
        handed_row(own_splat.c, from_),
        handed_row(own_splat.a_low, from_),
        handed_clip(own_splat.clip, from_),
        handed_cap(own_splat.cap, from_),
        handed_fade(own_splat.fade, from_),
    );
}

fn handed_attributes(own: Attributes, from_: u32) -> Attributes {
    let c = own.color;
    return Attributes(
        vec4<f32>(
            handed_number(c.x, from_),
            handed_number(c.y, from_),
            handed_number(c.z, from_),
            handed_number(c.w, from_),
        ),
        handed_vector(own.normal, from_),
        handed_bend(own.bend, from_),
        handed_number(own.radius, from_),
        handed_place(own.place, from_),
    );
}

// Updates the nearest depths, `front`, of the four pixels from row `y` down with the splat's
// fragments.
fn nearer(front: vec4<f32>, splat: Splat, filter_: Filter, x: u32, y: u32) -> vec4<f32> {
    var nearest_ = front;
    for (var k = 0u; k < 4u; k++) {
        let fragment = footprint(splat, filter_, x, y + k);
        let shows = fragment.hit && takes_sample(splat.fade, x, y + k);
        nearest_[k] = select(front[k], min(front[k], fragment.depth), shows);
    }
    return nearest_;
}

fn farthest_of(a: vec4<f32>, b: vec4<f32>) -> f32 {
    let m = max(a, b);
    return farthest_in_tile(max(max(m.x, m.y), max(m.z, m.w)));
}

// The nearest depths of four pixels, from the column's `first` on. Those past its end are 0, the
// nearest possible depth.
fn load(column: Column, first: u32) -> vec4<f32> {
    var depths = vec4<f32>(0.0);
    for (var k = 0u; k < 4u; k++) {
        if (first + k < column.pixels) {
            depths[k] = bitcast<f32>(kept_depth(atomicLoad(&nearest[column.pixel + (first + k) * held.width])));
        }
    }
    return depths;
}

fn store(column: Column, first: u32, depths: vec4<f32>) {
    for (var k = 0u; k < 4u; k++) {
        if (first + k < column.pixels) {
            atomicStore(&nearest[column.pixel + (first + k) * held.width], kept_depth(bitcast<u32>(depths[k])));
        }
    }
}

@compute @workgroup_size(WORKGROUP)
fn tile_visibility(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    hold_lane();
    let column = column_of_all(workgroup, workgroups, local);
    let listed = large_listed(column);
    if (listed == 0u) {
        return;
    }
    var a = load(column, 0u);
    var b = load(column, 4u);
    var c = load(column, 8u);
    var d = load(column, 12u);
    for (var place = 0u; place < listed; place += FETCHED) {
        var wanted = fetch(place, listed, column, vec2<f32>(farthest_of(a, b), farthest_of(c, d)));
        while (wanted.x != 0u) {
            let next = firstTrailingBit(wanted.x);
            wanted.x &= wanted.x - 1u;
            let splat = handed_splat(next);
            let filter_ = handed_filter(own_filter, next);
            a = nearer(a, splat, filter_, column.x, column.y);
            b = nearer(b, splat, filter_, column.x, column.y + 4u);
        }
        while (wanted.y != 0u) {
            let next = firstTrailingBit(wanted.y);
            wanted.y &= wanted.y - 1u;
            let splat = handed_splat(next);
            let filter_ = handed_filter(own_filter, next);
            c = nearer(c, splat, filter_, column.x, column.y + 8u);
            d = nearer(d, splat, filter_, column.x, column.y + 12u);
        }
    }
    store(column, 0u, a);
    store(column, 4u, b);
    store(column, 8u, c);
    store(column, 12u, d);
}

fn fronts_of(column: Column, k: u32) -> vec4<f32> {
    return vec4<f32>(front_of(column, k), front_of(column, k + 1u), front_of(column, k + 2u), front_of(column, k + 3u));
}

// Sums the fragments of a splat at eight pixels of the column, from `slot` on; `a` and `b` have the
// nearest depths of these pixels. The calls are written out, so that no register is indexed by a
// run-time value.
fn gather_eight(slot: u32, next: u32, own_attributes: Attributes, a: vec4<f32>, b: vec4<f32>, column: Column) {
    let splat = handed_splat(next);
    let filter_ = handed_filter(own_filter, next);
    let attributes = handed_attributes(own_attributes, next);
    gather(slot, splat, filter_, attributes, a.x, column);
    gather(slot + 1u, splat, filter_, attributes, a.y, column);
    gather(slot + 2u, splat, filter_, attributes, a.z, column);
    gather(slot + 3u, splat, filter_, attributes, a.w, column);
    gather(slot + 4u, splat, filter_, attributes, b.x, column);
    gather(slot + 5u, splat, filter_, attributes, b.y, column);
    gather(slot + 6u, splat, filter_, attributes, b.z, column);
    gather(slot + 7u, splat, filter_, attributes, b.w, column);
}

// Sums the fragments of all splats of the tile, in registers.
fn sum_tile(column: Column) {
    let a = fronts_of(column, 0u);
    let b = fronts_of(column, 4u);
    let c = fronts_of(column, 8u);
    let d = fronts_of(column, 12u);
    let deepest = vec2<f32>(deepest_accepted(farthest_of(a, b)), deepest_accepted(farthest_of(c, d)));
    let listed = all_listed(column);
    for (var place = 0u; place < listed; place += FETCHED) {
        var wanted = fetch(place, listed, column, deepest);
        let own_attributes = attributes_of(own_surfel, own_splat);
        while (wanted.x != 0u) {
            let next = firstTrailingBit(wanted.x);
            wanted.x &= wanted.x - 1u;
            gather_eight(0u, next, own_attributes, a, b, column);
        }
        while (wanted.y != 0u) {
            let next = firstTrailingBit(wanted.y);
            wanted.y &= wanted.y - 1u;
            gather_eight(8u, next, own_attributes, c, d, column);
        }
    }
}

// Adds the sums of the listed splats of this page to those in storage.
@compute @workgroup_size(WORKGROUP)
fn tile_accumulate(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    hold_lane();
    let column = column_of_all(workgroup, workgroups, local);
    if (large_listed(column) == 0u) {
        return;
    }
    sum_tile(column);
    for (var k = 0u; k < column.pixels; k++) {
        show(k);
        deposit(column.pixel + k * held.width);
    }
}

// Sums and resolves at once, without storing the sums. Used where the tiles' lists contain all
// splats; runs over covered tiles only.
@compute @workgroup_size(WORKGROUP)
fn tile_resolve(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    hold_lane();
    let column = column_of(covered_tile(linear_index(workgroup, workgroups, local) / TILE_WIDTH), local);
    sum_tile(column);
    resolve_column(column, local);
}
