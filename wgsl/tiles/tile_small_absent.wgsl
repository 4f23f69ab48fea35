// Tiles draw large splats only. Same interface as tile_small.wgsl.

fn small_list(tile: u32) -> vec2<u32> {
    return vec2<u32>(0u);
}

fn small_entry(at: u32) -> u32 {
    return 0u;
}
