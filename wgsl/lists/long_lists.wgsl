// Lists that are too long for the loops of one invocation. Each is sorted and composited over
// several dispatches, each of which does a part and stores where it stopped. Same interface as
// long_lists_absent.wgsl.
// Host side and bounds: src/passes/long_lists.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xd50948f00032dae2
// #import *::{CHANNELS}
// #import compositing::{Compositing, begun}
// #import footprint::{band_pixels}
// #import fragments::{keys, list_of}
// #import fragments_sort::{pop, sink}
// #import layer_sums::{layer_high, layer_low}
// #import layers|sorted::{composite_on}
// #import layout::{WORKGROUP, held, held_band, hold, linear_index}
// #import resolve::{IMAGE_WORDS}
// #import resolve_lists::{Shown}

// The number of long lists; then, for each list, its pixel, the number of finished steps of its
// heap sort, whether compositing has begun, and the state of compositing.
@group(0) @binding(66) var<storage, read_write> found_lists: array<atomic<u32>>;
@group(0) @binding(67) var<storage, read_write> long_lists: array<u32>;

// The greatest length of a list that one invocation sorts and composites in one dispatch.
override LONG: u32;
// The most that one dispatch does for a list: steps of the heap sort, and fragments visited.
override HEAP_STEPS: u32;
override LOOKS: u32;

const LONG_HEAD: u32 = 1u;
const LONG_WORDS: u32 = 40u;
const SO_FAR: u32 = 3u;
const SO_FAR_SUMS: u32 = 16u;

fn is_long(list: vec2<u32>) -> bool {
    return list.y > list.x + LONG;
}

// The rounds left to this invocation in this dispatch; one round visits a fragment. A list that is
// not long never uses them up.
var<private> rounds_left: u32 = 0xffffffffu;

fn has_rounds() -> bool {
    return rounds_left > 0u;
}

// Takes a round if one is left, and returns whether there was one.
fn next_round() -> bool {
    let has = rounds_left > 0u;
    rounds_left -= u32(has);
    return has;
}

// Collects the long lists, numbered in arbitrary order; no image depends on that order. One
// invocation per pixel.
@compute @workgroup_size(WORKGROUP)
fn find_long_lists(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let pixel = linear_index(workgroup, workgroups, local);
    if (pixel >= band_pixels() || !is_long(list_of(pixel))) {
        return;
    }
    let at = LONG_HEAD + atomicAdd(&found_lists[0], 1u) * LONG_WORDS;
    if (at + LONG_WORDS <= arrayLength(&found_lists)) {
        atomicStore(&found_lists[at], pixel);
        atomicStore(&found_lists[at + 1u], 0u);
        atomicStore(&found_lists[at + 2u], 0u);
    }
}

// The word at which the state of long list `number` starts; the buffer's length if there is no such
// list.
fn kept_of(number: u32) -> u32 {
    let room = (arrayLength(&long_lists) - LONG_HEAD) / LONG_WORDS;
    return select(arrayLength(&long_lists), LONG_HEAD + number * LONG_WORDS, number < min(long_lists[0], room));
}

// The number of steps of sort_many(): a sink() for each key with children in the heap, then a pop()
// for each key that leaves it.
fn heap_steps(count: u32) -> u32 {
    return count / 2u + count - 1u;
}

fn heap_step(first: u32, count: u32, step: u32) {
    let half = count / 2u;
    if (step < half) {
        sink(first, count, half - 1u - step);
    } else {
        pop(first, count - 1u - (step - half));
    }
}

// One invocation per long list.
@compute @workgroup_size(WORKGROUP)
fn sort_long_lists(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let kept = kept_of(linear_index(workgroup, workgroups, local));
    if (kept >= arrayLength(&long_lists)) {
        return;
    }
    let list = list_of(long_lists[kept]);
    let first = long_lists[kept + 1u];
    let end = min(first + HEAP_STEPS, heap_steps(list.y - list.x));
    for (var step = first; step < end; step++) {
        heap_step(list.x, list.y - list.x, step);
    }
    long_lists[kept + 1u] = end;
}

fn kept_float(at: u32) -> f32 {
    return bitcast<f32>(long_lists[at]);
}

// Loads the state of a list whose compositing has begun, and the sums of its unfinished surface.
fn compositing_at(kept: u32) -> Compositing {
    let at = kept + SO_FAR;
    for (var channel = 0u; channel < CHANNELS; channel++) {
        layer_low[channel] = long_lists[kept + SO_FAR_SUMS + 2u * channel];
        layer_high[channel] = long_lists[kept + SO_FAR_SUMS + 2u * channel + 1u];
    }
    let color = vec4<f32>(kept_float(at), kept_float(at + 1u), kept_float(at + 2u), kept_float(at + 3u));
    let shown = Shown(color, kept_float(at + 4u), long_lists[at + 5u], kept_float(at + 6u));
    let told = vec2<f32>(kept_float(at + 7u), kept_float(at + 8u));
    let joined = long_lists[at + 12u] != 0u;
    return Compositing(shown, told, long_lists[at + 9u], long_lists[at + 10u], kept_float(at + 11u), joined);
}

fn keep_compositing(kept: u32, so_far: Compositing) {
    let at = kept + SO_FAR;
    for (var channel = 0u; channel < CHANNELS; channel++) {
        long_lists[kept + SO_FAR_SUMS + 2u * channel] = layer_low[channel];
        long_lists[kept + SO_FAR_SUMS + 2u * channel + 1u] = layer_high[channel];
    }
    for (var k = 0u; k < 4u; k++) {
        long_lists[at + k] = bitcast<u32>(so_far.shown.color[k]);
    }
    long_lists[at + 4u] = bitcast<u32>(so_far.shown.transmittance);
    long_lists[at + 5u] = so_far.shown.layers;
    long_lists[at + 6u] = bitcast<u32>(so_far.shown.tail);
    long_lists[at + 7u] = bitcast<u32>(so_far.told.x);
    long_lists[at + 8u] = bitcast<u32>(so_far.told.y);
    long_lists[at + 9u] = so_far.first;
    long_lists[at + 10u] = so_far.key;
    long_lists[at + 11u] = bitcast<u32>(so_far.farthest);
    long_lists[at + 12u] = u32(so_far.joined);
}

// One invocation per long list, which writes the maps of its surfaces. The pixel itself is resolved
// with all others.
@compute @workgroup_size(WORKGROUP)
fn composite_long_lists(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let kept = kept_of(linear_index(workgroup, workgroups, local));
    if (kept >= arrayLength(&long_lists)) {
        return;
    }
    let pixel = long_lists[kept];
    let list = list_of(pixel);
    var so_far = begun(list);
    if (long_lists[kept + 2u] != 0u) {
        so_far = compositing_at(kept);
    }
    long_lists[kept + 2u] = 1u;
    if (so_far.first >= list.y) {
        return;
    }
    rounds_left = LOOKS;
    so_far = composite_on(so_far, list.y, pixel * IMAGE_WORDS, pixel % held.width, pixel / held.width + held_band.first_row);
    keep_compositing(kept, so_far);
    if (so_far.first >= list.y) {
        keep_composited(list, so_far.shown);
    }
}

// Stores the result in place of the keys of the list's first fragments, which are composited by
// then.
fn keep_composited(list: vec2<u32>, shown: Shown) {
    let color = bitcast<vec4<u32>>(shown.color);
    keys[list.x] = color.xy;
    keys[list.x + 1u] = color.zw;
    keys[list.x + 2u] = vec2<u32>(bitcast<u32>(shown.transmittance), shown.layers);
    keys[list.x + 3u] = vec2<u32>(bitcast<u32>(shown.tail), 0u);
}

fn composited(list: vec2<u32>) -> Shown {
    let color = bitcast<vec4<f32>>(vec4<u32>(keys[list.x], keys[list.x + 1u]));
    let shows = keys[list.x + 2u];
    return Shown(color, bitcast<f32>(shows.x), shows.y, bitcast<f32>(keys[list.x + 3u].x));
}
