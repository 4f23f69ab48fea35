// The lists of small splats, one per tile, where tiles draw small splats too. Same interface as
// tile_small_absent.wgsl.
// #import bin::{LIST_ENDS, lists_start, tile_size}

@group(0) @binding(28) var<storage, read> small_lists: array<u32>;

// The start and the end of a tile's list.
fn small_list(tile: u32) -> vec2<u32> {
    let end = LIST_ENDS + 1u + tile;
    let list = vec2<u32>(small_lists[end - 1u], small_lists[end]) + lists_start(tile_size());
    return min(list, vec2<u32>(arrayLength(&small_lists)));
}

fn small_entry(at: u32) -> u32 {
    return small_lists[at];
}
