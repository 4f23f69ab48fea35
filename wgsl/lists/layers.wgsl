// Stage 4: splits a pixel's fragments into surfaces, blends each surface as blend.wgsl blends the
// nearest one, and composites the surfaces from front to back. Same interface as sorted.wgsl.
// Twin: src/passes/layers.rs.
// All loops end, by 1, 6 of src/gpu/loops.rs: 0x92b6c9dfd975d317
// #import *::{quantise, resolve_color, sum_at, surface_depth}
// #import blend::{attributes_without_place, blend_weighted}
// #import compositing::{Compositing, with_joined}
// #import curved|facing|flat::{Bend}
// #import epsilon_*::{farthest_shown}
// #import fragments::{Record, keys, listed_color, listed_normal, listed_radius, listed_weight}
// #import fragments::{record_at}
// #import join_lists::{has_triangle, is_behind_triangle, triangle_depth}
// #import layer_sums::{clear_sums}
// #import layout::{WEIGHT_CHANNEL}
// #import long_lists::{has_rounds, next_round}
// #import maps::{write_surface}
// #import normal::{resolve_normal}
// #import resolve::{shaded}
// #import resolve_lists::{LEAST_TRANSMITTANCE, Shown, with_behind}
// #import side::{SIDES, SIDE_BIT}

override MOST_LAYERS: u32;
// Whether everything behind the last layer is drawn as one more layer, the tail.
override TAIL: bool;

fn depth_at(key: u32) -> f32 {
    return bitcast<f32>(keys[key].x);
}

// The side that a fragment shows: 1 for a back.
fn side_at(key: u32) -> u32 {
    return select(0u, keys[key].x & SIDE_BIT, SIDES);
}

// Whether no layer has consumed the fragment yet. `told` has the depths up to which the fragments
// of either side are consumed.
fn is_untold(key: u32, told: vec2<f32>) -> bool {
    return depth_at(key) > select(told.x, told.y, side_at(key) == 1u);
}

fn blend_listed(record: Record, key: u32, front: f32) {
    let attributes = attributes_without_place(listed_color(record), vec3<f32>(0.0), no_bend(), 0.0);
    blend_weighted(0u, quantise(listed_weight(record)), depth_at(key), front, listed_normal(record), attributes);
}

fn no_bend() -> Bend {
    var none: Bend;
    return none;
}

// Sums the fragments of the surface that starts at `first`, from `key` on, until the surface ends
// or this dispatch has no rounds left (next_round() in long_lists.wgsl).
fn sum_surface(begun: Compositing, end: u32, image: vec2<f32>) -> Compositing {
    var so_far = begun;
    let front = depth_at(so_far.first);
    let side = side_at(so_far.first);
    for (; so_far.key < end && next_round(); so_far.key++) {
        let depth = depth_at(so_far.key);
        if (side_at(so_far.key) != side) {
            continue;
        }
        // The first fragment is the front itself.
        if (so_far.key != so_far.first && depth > so_far.farthest) {
            break;
        }
        let record = record_at(keys[so_far.key].y);
        let radius = listed_radius(record);
        so_far.farthest = max(so_far.farthest, farthest_shown(depth, radius, image));
        if (depth <= farthest_shown(front, radius, image)) {
            blend_listed(record, so_far.key, front);
        }
    }
    return so_far;
}

// Sums all fragments that no layer has consumed, from `key` on, until the list ends or this
// dispatch has no rounds left.
fn sum_rest(begun: Compositing, end: u32) -> Compositing {
    var so_far = begun;
    let front = depth_at(so_far.first);
    for (; so_far.key < end && next_round(); so_far.key++) {
        if (is_untold(so_far.key, so_far.told)) {
            blend_listed(record_at(keys[so_far.key].y), so_far.key, front);
        }
    }
    return so_far;
}

// Continues to composite the list, which ends at `end`. The maps of its surfaces are at `out`. The
// pixel's triangle is one of the surfaces.
fn composite_on(before: Compositing, end: u32, out: u32, x: u32, y: u32) -> Compositing {
    let image = vec2<f32>(vec2<u32>(x, y)) + 0.5;
    let triangle = triangle_depth(x, y);
    var so_far = before;
    loop {
        while (so_far.first < end && !is_untold(so_far.first, so_far.told) && next_round()) {
            so_far.first++;
        }
        if (so_far.first >= end || !has_rounds()) {
            break;
        }
        let is_last = so_far.shown.layers >= MOST_LAYERS;
        var front = depth_at(so_far.first);
        if (so_far.key <= so_far.first) {
            clear_sums();
            so_far.key = so_far.first;
            so_far.farthest = front;
        }
        if (is_last) {
            so_far = sum_rest(so_far, end);
            // A tail has no side.
            front = bitcast<f32>(bitcast<u32>(front) & ~SIDE_BIT);
        } else {
            so_far = sum_surface(so_far, end, image);
        }
        if (!has_rounds()) {
            break;
        }
        let joins = !so_far.joined && is_behind_triangle(summed_depth(is_last, front), triangle);
        if (joins) {
            so_far = with_joined(so_far, triangle, out, x, y);
            // With one layer fewer, the surface may belong to the tail, so it is summed again.
            so_far.key = so_far.first;
        } else {
            so_far = with_surface(so_far, is_last, front, out, x, y);
        }
        if ((is_last && !joins) || !shows_more(so_far.shown)) {
            so_far.first = end;
        }
    }
    if (so_far.first >= end && !so_far.joined && has_triangle(triangle) && shows_more(so_far.shown)) {
        so_far = with_joined(so_far, triangle, out, x, y);
    }
    return so_far;
}

// Whether a surface behind the shown ones would show.
fn shows_more(shown: Shown) -> bool {
    return shown.transmittance >= LEAST_TRANSMITTANCE && (shown.layers < MOST_LAYERS || TAIL);
}

// The depth of the summed surface: blended, or that of the tail's nearest fragment.
fn summed_depth(is_last: bool, front: f32) -> f32 {
    return select(surface_depth(0u, sum_at(0u, WEIGHT_CHANNEL), front), front, is_last);
}

// Composites the summed surface behind what is shown.
fn with_surface(summed: Compositing, is_last: bool, front: f32, out: u32, x: u32, y: u32) -> Compositing {
    var so_far = summed;
    let weight = sum_at(0u, WEIGHT_CHANNEL);
    let normal = resolve_normal(0u, weight, front);
    let color = shaded(resolve_color(0u, weight), normal, x, y);
    write_surface(out, so_far.shown.layers, summed_depth(is_last, front), color.a);
    let tail = select(0.0, so_far.shown.transmittance * color.a, is_last);
    so_far.shown = with_behind(so_far.shown, color);
    so_far.shown.tail = tail;
    let is_back = side_at(so_far.first) == 1u;
    so_far.told = select(vec2<f32>(so_far.farthest, so_far.told.y), vec2<f32>(so_far.told.x, so_far.farthest), is_back);
    so_far.key = so_far.first;
    return so_far;
}
