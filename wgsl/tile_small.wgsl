// Where tiles have the small splats too: their lists, a cell a tile.

@group(0) @binding(28) var<storage, read> small_lists: array<u32>;

// Where the list of a tile starts and ends.
fn small_list(tile: u32) -> vec2<u32> {
    let end = LIST_ENDS + 1u + tile;
    let list = vec2<u32>(small_lists[end - 1u], small_lists[end]) + lists_start(tile_size());
    return min(list, vec2<u32>(arrayLength(&small_lists)));
}

fn small_entry(at: u32) -> u32 {
    return small_lists[at];
}
