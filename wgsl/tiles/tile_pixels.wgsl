// Resolves the pixels of a tile's column, with one sample per pixel. Same interface as
// tile_samples.wgsl.
// All loops end, by 1 of src/gpu/loops.rs: 0x580a95c3715cde77
// #import column::{Column}
// #import layout::{held}
// #import resolve_*::{resolve_pixel}

fn resolve_column(column: Column, local: u32) {
    for (var k = 0u; k < column.pixels; k++) {
        resolve_pixel(k, column.pixel + k * held.width, column.x, column.y + k);
    }
}
