// Where tiles have the small splats too: their lists, a cell a tile.

@group(0) @binding(30) var<storage, read> small_ends: array<u32>;
@group(0) @binding(31) var<storage, read> small_lists: array<u32>;

// Where the list of the tile in column `x` and row `y` starts and ends.
fn small_list(x: u32, y: u32) -> vec2<u32> {
    let cell = y * cells_across(TILE_SIDE) + x;
    return min(vec2<u32>(small_ends[cell], small_ends[cell + 1u]), vec2<u32>(arrayLength(&small_lists)));
}

fn small_entry(at: u32) -> u32 {
    return small_lists[at];
}
