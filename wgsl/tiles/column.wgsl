// The pixels of a tile that one invocation draws, for both designs of tiles: tile.wgsl, where it is
// a column of pixels, and staged.wgsl, where it is one pixel.
// #import *::{Term, front_at}
// #import bin::{BLOCK_SIDE, BLOCK_SIZE, LIST_ENDS, cells_across, lists_start}
// #import blend::{blend_weighted, weight_of}
// #import blend|winner::{Attributes}
// #import covered::{tiles_in_band}
// #import filter|lowpass_none::{Filter}
// #import footprint::{footprint}
// #import layout::{NOTHING, Splat, held, held_band}
// #import normal_*::{normal_at}
// #import side::{is_shown}
// #import texture::{accumulate_place}
// #import tile_small::{small_entry, small_list}

// The lists of the large splats.
@group(0) @binding(27) var<storage, read> large_lists: array<u32>;

// The pixels of this invocation, from (x, y) down. `pixel` is the index of the first one in the
// band, `pixels` is their number, without those past the edge of the image. `large` and `small` are
// the start and the end of the tile's list of large and of small splats.
struct Column {
    x: u32,
    y: u32,
    pixel: u32,
    pixels: u32,
    large: vec2<u32>,
    small: vec2<u32>,
}

// The `pixels` pixels of `tile` from column `x` and row `row` of the band down. A number that is no
// tile gives a column without pixels and without lists.
fn column_at(tile: u32, x: u32, row: u32, pixels: u32) -> Column {
    var column = Column(x, row + held_band.first_row, row * held.width + x, 0u, vec2<u32>(0u), vec2<u32>(0u));
    if (tile < tiles_in_band()) {
        let end = LIST_ENDS + 1u + row / BLOCK_SIDE * cells_across(BLOCK_SIZE) + x / BLOCK_SIDE;
        let list = vec2<u32>(large_lists[end - 1u], large_lists[end]) + lists_start(BLOCK_SIZE);
        column.large = min(list, vec2<u32>(arrayLength(&large_lists)));
        column.small = small_list(tile);
        column.pixels = select(0u, min(pixels, held_band.rows - min(row, held_band.rows)), x < held.width);
    }
    return column;
}

// The number of large splats in the column's list, and of all splats in both lists.
fn large_listed(column: Column) -> u32 {
    return column.large.y - column.large.x;
}

fn all_listed(column: Column) -> u32 {
    return large_listed(column) + (column.small.y - column.small.x);
}

// The slot of an entry of the lists; the large splats come first.
fn listed_slot(column: Column, at: u32) -> u32 {
    let large = large_listed(column);
    if (at < large) {
        return large_lists[column.large.x + at];
    }
    return small_entry(column.small.x + (at - large));
}

// The nearest depth at pixel `k` of the column; 0, in front of every fragment, if the pixel is
// empty or past the end of the column.
fn front_of(column: Column, k: u32) -> f32 {
    if (k >= column.pixels) {
        return 0.0;
    }
    let front = front_at(column.pixel + k * held.width);
    return select(front, 0.0, bitcast<u32>(front) == NOTHING);
}

// Sums the fragment of a splat at pixel `slot` of the column, whose nearest depth is `front`.
fn gather(slot: u32, splat: Splat, filter_: Filter, attributes: Attributes, front: f32, column: Column) {
    let fragment = footprint(splat, filter_, column.x, column.y + slot);
    // A rejected fragment adds a weight of 0. For a branch, a compiler would emit a select for each
    // stored sum instead.
    let at = vec2<u32>(column.x, column.y + slot);
    let accepted = is_shown(fragment, front, attributes.radius, at);
    let weight = select(Term(0), weight_of(fragment), accepted);
    let depth = select(front, fragment.depth, accepted);
    let normal = normal_at(attributes, fragment.spot);
    accumulate_place(slot, weight, attributes.place, at, depth);
    blend_weighted(slot, weight, depth, front, normal, attributes);
}
