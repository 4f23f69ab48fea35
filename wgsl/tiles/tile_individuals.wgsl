// Keeps the nearest surfaces at the pixels or samples of a tile's column, for pictures whose inputs
// are blended separately (individuals.wgsl). Same interface as tile_pixels.wgsl.
// All loops end, by 1 of src/gpu/loops.rs: 0x2644c463de12ae18
// #import column::{Column}
// #import individuals::{keep_nearest_of}
// #import layout::{held}

fn resolve_column(column: Column, local: u32) {
    for (var k = 0u; k < column.pixels; k++) {
        keep_nearest_of(k, column.pixel + k * held.width, column.x, column.y + k);
    }
}
