// Resolves the samples of a tile's column. A pixel may have samples in several columns; they are
// added in the order of resolve_samples.wgsl. Same interface as tile_pixels.wgsl.
// All loops end, by 1 of src/gpu/loops.rs: 0xe8f9843fa8bb0301
// #import column::{Column}
// #import covered::{TILE_ROWS}
// #import layout::{WORKGROUP, held, held_band}
// #import resolve_*::{sample_color}
// #import resolve_samples::{SAMPLES_ACROSS, SAMPLES_DOWN, write_mean}

var<workgroup> of_column: array<vec4<f32>, WORKGROUP>;

fn resolve_column(column: Column, local: u32) {
    let row = column.y - held_band.first_row;
    for (var first = 0u; first < TILE_ROWS; first += SAMPLES_DOWN) {
        let exists = first < column.pixels;
        var sum = vec4<f32>(0.0);
        if (exists) {
            for (var k = first; k < first + SAMPLES_DOWN; k++) {
                sum += sample_color(k, column.pixel + k * held.width, column.x, row + k);
            }
        }
        of_column[local] = sum;
        workgroupBarrier();
        if (exists && column.x % SAMPLES_ACROSS == 0u) {
            for (var i = 1u; i < SAMPLES_ACROSS; i++) {
                sum += of_column[local + i];
            }
            write_mean(vec2<u32>(column.x, row + first), sum);
        }
        workgroupBarrier();
    }
}
