// No triangles show. Same interface as triangles_tiles.wgsl.

fn has_triangles(tile: u32) -> bool {
    return false;
}
