// Stage 3 where surfaces show through each other: makes a list of each pixel's fragments. The
// visibility pass has counted the fragments of each pixel. A prefix sum over rows, and one over the
// pixels of each row, turn the counts into starts of lists. Then every fragment takes a place in
// its pixel's list.
// Host side and twin: src/passes/fragments.rs.
// All loops end, by 1, 2, 4 of src/gpu/loops.rs: 0x099889a819ef66ae
// #import accumulator_raster|front::{visible}
// #import accumulator_raster|visibility::{nearest}
// #import blend::{fragment_weight}
// #import blend|winner::{Attributes, attributes_of}
// #import camera_orthographic|perspective::{Fragment}
// #import cull|cull_absent|cull_twice::{slot_of, surfel_in}
// #import filter|lowpass_none::{filter_in}
// #import footprint::{TILE, band_pixels, footprint, is_large, large_splat, pixel_index, reach}
// #import fragments_*::{is_listed, with_rank}
// #import layout::{Splat, WORKGROUP, held, held_band, hold, linear_index}
// #import normal_*::{normal_at}
// #import raster|visibility::{projected}
// #import records::{SplatRecord, splat_of}
// #import resolve::{OPACITY}
// #import words|words_long::{Words, each_word, words}

// The number of all fragments, and the greatest number at one pixel; then the start of each row's
// lists and the end of the last row's; then the start of each pixel's list and the end of the last.
// Numbers of fragments saturate at MOST_FRAGMENTS. `starts` is the same buffer, read-only.
@group(0) @binding(44) var<storage, read_write> list_starts: array<u32>;
@group(0) @binding(45) var<storage, read> starts: array<u32>;

const STARTS_HEAD: u32 = 2u;
const MOST_FRAGMENTS: u32 = 0xffffffffu;

fn pixels_start() -> u32 {
    return STARTS_HEAD + held_band.rows + 1u;
}

fn sum_or_most(a: u32, b: u32) -> u32 {
    return select(a + b, MOST_FRAGMENTS, a + b < a);
}

// Counts the fragments of a row. One invocation per row.
@compute @workgroup_size(WORKGROUP)
fn fragments_of_rows(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let row = linear_index(workgroup, workgroups, local);
    if (row >= held_band.rows) {
        return;
    }
    var total = 0u;
    var most = 0u;
    for (var x = 0u; x < held.width; x++) {
        let count = visible_count(row * held.width + x);
        total = sum_or_most(total, count);
        most = max(most, count);
    }
    list_starts[STARTS_HEAD + row] = total;
    // Until start_pixels overwrites it, the first word of a row's pixels holds the row's maximum.
    list_starts[pixels_start() + row * held.width] = most;
}

// Turns the counts of rows into starts.
@compute @workgroup_size(1)
fn start_rows() {
    hold();
    var total = 0u;
    var most = 0u;
    for (var row = 0u; row < held_band.rows; row++) {
        let count = list_starts[STARTS_HEAD + row];
        list_starts[STARTS_HEAD + row] = total;
        total = sum_or_most(total, count);
        most = max(most, list_starts[pixels_start() + row * held.width]);
    }
    list_starts[STARTS_HEAD + held_band.rows] = total;
    list_starts[pixels_start() + band_pixels()] = total;
    list_starts[0] = total;
    list_starts[1] = most;
}

@compute @workgroup_size(WORKGROUP)
fn start_pixels(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let row = linear_index(workgroup, workgroups, local);
    if (row >= held_band.rows) {
        return;
    }
    var start = list_starts[STARTS_HEAD + row];
    for (var x = 0u; x < held.width; x++) {
        let pixel = row * held.width + x;
        list_starts[pixels_start() + pixel] = start;
        start = sum_or_most(start, visible_count(pixel));
    }
}

// The number of a pixel's fragments that have no place yet.
fn visible_count(pixel: u32) -> u32 {
    return atomicLoad(&nearest[pixel]);
}

// The depth of each fragment, and the index of its record.
@group(0) @binding(46) var<storage, read_write> keys: array<vec2<u32>>;
@group(0) @binding(47) var<storage, read_write> fragments: array<Words>;

// A record has this many rows of four words. Its first word is the weight; the constants below are
// the words of the other values (FragmentLayout in src/plan/fragment.rs).
override FRAGMENT_ROWS: u32;
override FRAGMENT_COLOR: u32;
override FRAGMENT_COLORS: u32;
override FRAGMENT_NORMAL: u32;
override FRAGMENT_RADIUS: u32;
// Whether a record has these values.
override FRAGMENT_HAS_NORMAL: bool;
override FRAGMENT_HAS_RADIUS: bool;

const MOST_FRAGMENT_WORDS: u32 = 12u;
alias Record = array<u32, MOST_FRAGMENT_WORDS>;

// Stores a fragment in its pixel's list, unless it is too faint or too deep to be listed.
fn list_fragment(pixel: u32, fragment: Fragment, surfel: u32, attributes: Attributes) {
    let weight = fragment_weight(fragment);
    if (!is_listed(pixel, fragment, weight * OPACITY * (held.color_low.a + held.color_span.a * attributes.color.a))) {
        return;
    }
    // The places are taken from the last to the first. If the counting kernel decided otherwise
    // about a fragment at a rim, one fragment may find no place, and is left out.
    let left = atomicSub(&nearest[pixel], 1u);
    let at = starts[pixels_start() + pixel] + (left - 1u);
    if (left > starts[pixels_start() + pixel + 1u] - starts[pixels_start() + pixel] || left == 0u) {
        return;
    }
    keys[at] = vec2<u32>(bitcast<u32>(fragment.depth), at);
    var record: Record;
    record[0] = bitcast<u32>(weight);
    for (var k = 0u; k < FRAGMENT_COLORS; k++) {
        record[FRAGMENT_COLOR + k] = bitcast<u32>(attributes.color[k]);
    }
    if (FRAGMENT_HAS_NORMAL) {
        let normal = normal_at(attributes, fragment.spot);
        for (var k = 0u; k < 3u; k++) {
            record[FRAGMENT_NORMAL + k] = bitcast<u32>(normal[k]);
        }
    }
    if (FRAGMENT_HAS_RADIUS) {
        record[FRAGMENT_RADIUS] = bitcast<u32>(attributes.radius);
    }
    record = with_rank(record, surfel);
    for (var row = 0u; row < FRAGMENT_ROWS; row++) {
        let word = 4u * row;
        fragments[at * FRAGMENT_ROWS + row] =
            words(vec4<u32>(record[word], record[word + 1u], record[word + 2u], record[word + 3u]));
    }
}

// Lists the splat's fragments at the pixels from `offset` on, in steps of `step`, with one
// invocation. As in accumulate.wgsl, each round of the outer loop first finds the next fragment and
// then lists it, so that the invocations of a subgroup do the expensive part together.
fn list_splat(slot: u32, splat: Splat, record: SplatRecord, offset: vec2<u32>, step: u32) {
    let filter_ = filter_in(record);
    let surfel = surfel_in(record, slot);
    let attributes = attributes_of(surfel, splat);
    let pixels = reach(splat);
    let first = pixels.first + offset;
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
        list_fragment(pixel_index(place.x, place.y), fragment, surfel, attributes);
    }
}

@compute @workgroup_size(WORKGROUP)
fn list_fragments(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let slot = slot_of(workgroup, workgroups, local);
    if (slot < arrayLength(&projected)) {
        let record = projected[slot];
        let splat = splat_of(record);
        if (!is_large(splat)) {
            list_splat(slot, splat, record, vec2<u32>(0u), 1u);
        }
    }
}

@compute @workgroup_size(TILE, TILE)
fn list_fragments_large(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    hold();
    let slot = large_splat(workgroup.y * workgroups.x + workgroup.x);
    if (slot < arrayLength(&projected)) {
        let record = projected[slot];
        list_splat(slot, splat_of(record), record, local.xy, TILE);
    }
}

// The start and the end of a pixel's list.
fn list_of(pixel: u32) -> vec2<u32> {
    let list = vec2<u32>(starts[pixels_start() + pixel], starts[pixels_start() + pixel + 1u]);
    // Free places, which no fragment took, come first, and `left` is their number. If `left` has
    // wrapped below 0, a fragment found no place, and none is free.
    let left = visible[pixel];
    return vec2<u32>(list.x + select(left, 0u, left > list.y - list.x), list.y);
}

fn record_at(at: u32) -> Record {
    var record: Record;
    for (var row = 0u; row < FRAGMENT_ROWS; row++) {
        let four = each_word(fragments[at * FRAGMENT_ROWS + row]);
        for (var k = 0u; k < 4u; k++) {
            record[4u * row + k] = four[k];
        }
    }
    return record;
}

fn listed_weight(record: Record) -> f32 {
    return bitcast<f32>(record[0]);
}

fn listed_color(record: Record) -> vec4<f32> {
    var color = vec4<f32>(0.0);
    for (var k = 0u; k < FRAGMENT_COLORS; k++) {
        color[k] = bitcast<f32>(record[FRAGMENT_COLOR + k]);
    }
    return color;
}

// The normal, mapped to [0, 1]; 0 if records have none.
fn listed_normal(record: Record) -> vec3<f32> {
    var normal = vec3<f32>(0.0);
    if (FRAGMENT_HAS_NORMAL) {
        for (var k = 0u; k < 3u; k++) {
            normal[k] = bitcast<f32>(record[FRAGMENT_NORMAL + k]);
        }
    }
    return normal;
}

fn listed_radius(record: Record) -> f32 {
    var radius = 0.0;
    if (FRAGMENT_HAS_RADIUS) {
        radius = bitcast<f32>(record[FRAGMENT_RADIUS]);
    }
    return radius;
}
