// The end of stage 2: stores the farthest of the nearest depths in each tile of pixels. With these,
// stage 3 skips completely hidden splats without reading their pixels. Skipping changes no image.
// Host side: src/passes/visibility.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x144ee753078b142b
// #import *::{nearest_at}
// #import accumulator_raster|front::{visible}
// #import accumulator_raster|visibility::{nearest}
// #import covered::{TILE_ROWS, TILE_WIDTH, tiles_across}
// #import curved|facing|flat::{nearest_on}
// #import epsilon_*::{farthest_accepted}
// #import filter|lowpass_none::{Filter, least_filtered}
// #import footprint::{Rectangle, band_pixels}
// #import layout::{NOTHING, Splat, WORKGROUP, held, held_band, hold, linear_index}

const OCCLUSION_TILE: u32 = 8u;

fn occlusion_tiles() -> vec2<u32> {
    return (vec2<u32>(held.width, held_band.rows) + OCCLUSION_TILE - 1u) / OCCLUSION_TILE;
}

// Stores the farthest of the tile's nearest depths; an empty pixel counts as `nothing`.
fn farthest_in(tile: u32, nothing: u32) {
    let tiles = occlusion_tiles();
    if (tile >= tiles.x * tiles.y) {
        return;
    }
    let first = vec2<u32>(tile % tiles.x, tile / tiles.x) * OCCLUSION_TILE;
    let end = min(first + OCCLUSION_TILE, vec2<u32>(held.width, held_band.rows));
    var farthest = 0u;
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            let front = nearest_at(y * held.width + x);
            farthest = max(farthest, select(front, nothing, front == NOTHING));
        }
    }
    // The tiles' words follow those of the band's pixels.
    atomicStore(&nearest[band_pixels() + tile], farthest);
}

// The word of `nearest` at which the list of covered tiles starts (covered.wgsl).
fn covered_start() -> u32 {
    let tiles = occlusion_tiles();
    return band_pixels() + tiles.x * tiles.y;
}

// Whether a tile of covered.wgsl, which consists of whole occlusion tiles, has a fragment.
fn has_any(tile: u32) -> bool {
    let tiles = occlusion_tiles();
    let size = vec2<u32>(TILE_WIDTH, TILE_ROWS) / OCCLUSION_TILE;
    let first = vec2<u32>(tile % tiles_across(), tile / tiles_across()) * size;
    let end = min(first + size, tiles);
    var farthest = 0u;
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            farthest |= atomicLoad(&nearest[band_pixels() + y * tiles.x + x]);
        }
    }
    return farthest != 0u;
}

// Runs after everything is drawn. Empty pixels stay empty then, so they count as depth 0. One
// invocation per tile.
@compute @workgroup_size(WORKGROUP)
fn occlude(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    farthest_in(linear_index(workgroup, workgroups, local), 0u);
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
