// The end of stage 2: stores the farthest of the nearest depths in each tile of pixels. With these,
// stage 3 skips completely hidden splats without reading their pixels. Skipping changes no image.
// The same kernel lists the tiles of the image that are not empty (covered.wgsl).
// Host side: src/passes/visibility.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x3d04acccaa4492c4
// #import *::{nearest_at}
// #import accumulator_raster|front::{visible}
// #import accumulator_raster|visibility::{nearest}
// #import covered::{TILE_ROWS, TILE_WIDTH, is_always_listed, list_tile, tiles_across}
// #import curved|facing|flat::{nearest_on}
// #import epsilon_*::{farthest_accepted}
// #import filter|lowpass_none::{Filter, least_filtered}
// #import footprint::{Rectangle, band_pixels}
// #import layout::{NOTHING, Splat, WORKGROUP, held, held_band, hold}

const OCCLUSION_TILE: u32 = 8u;

fn occlusion_tiles() -> vec2<u32> {
    return (vec2<u32>(held.width, held_band.rows) + OCCLUSION_TILE - 1u) / OCCLUSION_TILE;
}

// Stores the farthest of the nearest depths in the tile at a column and row of tiles, and returns
// it; an empty pixel counts as `nothing`. Past the last tile, returns 0.
fn farthest_in(at: vec2<u32>, nothing: u32) -> u32 {
    let tiles = occlusion_tiles();
    if (any(at >= tiles)) {
        return 0u;
    }
    let first = at * OCCLUSION_TILE;
    let end = min(first + OCCLUSION_TILE, vec2<u32>(held.width, held_band.rows));
    var farthest = 0u;
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            let front = nearest_at(y * held.width + x);
            farthest = max(farthest, select(front, nothing, front == NOTHING));
        }
    }
    // The tiles' words follow those of the band's pixels.
    atomicStore(&nearest[band_pixels() + at.y * tiles.x + at.x], farthest);
    return farthest;
}

// The word of `nearest` at which the list of covered tiles starts (covered.wgsl).
fn covered_start() -> u32 {
    let tiles = occlusion_tiles();
    return band_pixels() + tiles.x * tiles.y;
}

// The side of the square of occlusion tiles that a workgroup of occlude() has.
const OCCLUSION_BLOCK: u32 = 8u;

// For each tile of covered.wgsl in the workgroup's square: 1 if it has a fragment.
var<workgroup> group_covers: array<atomic<u32>, WORKGROUP>;

// Runs after everything is drawn. Empty pixels stay empty then, so they count as depth 0. Also
// lists the covered tiles, which consist of whole occlusion tiles. One invocation per occlusion
// tile.
@compute @workgroup_size(WORKGROUP)
fn occlude(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let across = (occlusion_tiles().x + OCCLUSION_BLOCK - 1u) / OCCLUSION_BLOCK;
    let block = workgroup.y * workgroups.x + workgroup.x;
    let inner = vec2<u32>(local % OCCLUSION_BLOCK, local / OCCLUSION_BLOCK);
    let at = vec2<u32>(block % across, block / across) * OCCLUSION_BLOCK + inner;
    let size = vec2<u32>(TILE_WIDTH, TILE_ROWS) / OCCLUSION_TILE;
    let own = inner.y / size.y * OCCLUSION_BLOCK + inner.x / size.x;
    if (farthest_in(at, 0u) != 0u) {
        atomicStore(&group_covers[own], 1u);
    }
    workgroupBarrier();
    let tile = at.y / size.y * tiles_across() + at.x / size.x;
    // The first occlusion tile of a covered tile lists it.
    let is_first = all(at < occlusion_tiles()) && all(at % size == vec2<u32>(0u));
    list_tile(tile, is_first && (is_always_listed(tile) || atomicLoad(&group_covers[own]) != 0u), local);
}

// 0 where a study leaves this optimisation out.
override HIDES: u32;

// Whether no fragment of the splat can be accepted at `pixels`. Testing against the farthest front
// of the tiles suffices, because the farthest accepted depth grows with the nearest depth.
fn hidden(splat: Splat, filter_: Filter, pixels: Rectangle, radius: f32) -> bool {
    if (any(pixels.first > pixels.last)) {
        return true;
    }
    if (HIDES == 0u) {
        return false;
    }
    let reached = nearest_reached(splat, filter_, pixels);
    let tiles = occlusion_tiles();
    let first = (pixels.first - vec2<u32>(0u, held_band.first_row)) / OCCLUSION_TILE;
    let last = (pixels.last - vec2<u32>(0u, held_band.first_row)) / OCCLUSION_TILE;
    // The bits of positive f32 order as their values.
    var front = 0u;
    let start = band_pixels();
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            front = max(front, visible[start + y * tiles.x + x]);
        }
    }
    return front == 0u || reached > farthest_accepted(bitcast<f32>(front), radius);
}

// A depth in front of every fragment of the splat at `pixels`, device units.
fn nearest_reached(splat: Splat, filter_: Filter, pixels: Rectangle) -> f32 {
    let first = vec2<f32>(vec2<i32>(pixels.first) - vec2<i32>(splat.anchor_x, splat.anchor_y));
    let last = vec2<f32>(vec2<i32>(pixels.last) - vec2<i32>(splat.anchor_x, splat.anchor_y));
    return min(nearest_on(splat, first, last), least_filtered(filter_)) * (1.0 - 1e-6);
}
