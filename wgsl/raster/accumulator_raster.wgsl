// Sums by the rasteriser's blender, four channels per target. The terms of a fragment are collected
// and returned together. The result of blending depends on the format of the targets and on the
// order of the fragments. Error bounds: src/passes/raster.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x7ebbbab195878c9c
// #import covered::{TILE_ROWS, TILE_WIDTH, is_always_listed, list_tile, tiles_across}
// #import covered::{tiles_in_band}
// #import layout::{WEIGHT_CHANNEL, WORKGROUP, held, held_band, hold, linear_index}
// #import raster_targets_*::{target_at}

// The factor on terms that keeps sums below 1 in formats that cannot hold more.
override BLEND_SCALE: f32;

alias Term = f32;
const COUNT_ONE: Term = 1.0;

var<private> terms: array<f32, 12>;

fn quantise(weight: f32) -> Term {
    return weight;
}

// The weight that a term stands for.
fn part_of(weight: Term) -> f32 {
    return weight;
}

fn term(weight: Term, value: f32) -> Term {
    return weight * clamp(value, 0.0, 1.0);
}

fn add(pixel: u32, channel: u32, value: Term) {
    terms[channel] = value;
}

fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

fn settle(pixel: u32) {}

fn four_terms(first: u32) -> vec4<f32> {
    return BLEND_SCALE * vec4<f32>(terms[first], terms[first + 1u], terms[first + 2u], terms[first + 3u]);
}

fn show(pixel: u32) {}

fn sum_at(pixel: u32, channel: u32) -> f32 {
    let place = vec2<u32>(pixel % held.width, pixel / held.width + held_band.first_row);
    return target_at(place, channel / 4u)[channel % 4u] / BLEND_SCALE;
}

fn weight_at(pixel: u32) -> f32 {
    return sum_at(pixel, WEIGHT_CHANNEL);
}

// This buffer holds only the list of covered tiles (covered.wgsl), because the rasteriser stores no
// depths in it.
@group(0) @binding(6) var<storage, read_write> nearest: array<atomic<u32>>;
@group(0) @binding(7) var<storage, read> visible: array<u32>;

fn covered_start() -> u32 {
    return 0u;
}

// Lists the covered tiles. One invocation per tile.
@compute @workgroup_size(WORKGROUP)
fn list_covered(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let tile = linear_index(workgroup, workgroups, local);
    list_tile(tile, tile < tiles_in_band() && (is_always_listed(tile) || has_weight(tile)), local);
}

// Whether a tile has a fragment.
fn has_weight(tile: u32) -> bool {
    let first = vec2<u32>(tile % tiles_across() * TILE_WIDTH, tile / tiles_across() * TILE_ROWS);
    let end = min(first + vec2<u32>(TILE_WIDTH, TILE_ROWS), vec2<u32>(held.width, held_band.rows));
    var any = false;
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            any = any || weight_at(y * held.width + x) != 0.0;
        }
    }
    return any;
}
