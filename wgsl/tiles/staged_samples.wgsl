// Resolves the samples of a tile, one an invocation. A pixel's samples are added in the order of
// resolve_samples.wgsl. Same interface as tile_pixels.wgsl.
// Kernels set the workgroup memory of this file before they read it.
// All loops end, by 1 of src/gpu/loops.rs: 0x06d05d4e246b6fed
// #import column::{Column}
// #import layout::{held_band}
// #import resolve_*::{sample_color}
// #import resolve_samples::{SAMPLES_ACROSS, SAMPLES_DOWN, write_mean}
// #import staged::{PIXELS, SIDE}

var<workgroup> of_sample: array<vec4<f32>, PIXELS>;

fn resolve_column(column: Column, local: u32) {
    let row = column.y - held_band.first_row;
    let exists = column.pixels > 0u;
    if (exists) {
        of_sample[local] = sample_color(0u, column.pixel, column.x, row);
    }
    workgroupBarrier();
    if (exists && column.x % SAMPLES_ACROSS == 0u && row % SAMPLES_DOWN == 0u) {
        var sum = vec4<f32>(0.0);
        for (var i = 0u; i < SAMPLES_ACROSS; i++) {
            var below = vec4<f32>(0.0);
            for (var j = 0u; j < SAMPLES_DOWN; j++) {
                below += of_sample[local + j * SIDE + i];
            }
            sum += below;
        }
        write_mean(vec2<u32>(column.x, row), sum);
    }
}
