// Tiles of surfels without textures. Same interface as tile_texture.wgsl.

const MOST_CHANNELS: u32 = 12u;

fn show_rest(slot: u32) {}
