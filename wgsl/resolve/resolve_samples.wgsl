// Several samples per pixel: writes the mean of their premultiplied colours (resolve_surface.wgsl,
// resolve_lists.wgsl). All other kernels treat samples as pixels. One workgroup per covered tile,
// one invocation per pixel. Same interface as resolve_pixels.wgsl. Twin: src/passes/resolve.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x2159d9d77d8a1b37
// #import covered::{TILE_ROWS, TILE_WIDTH, covered_tile, tiles_across, tiles_in_band}
// #import image_*::{write_color}
// #import layout::{WORKGROUP, held, held_band, hold}
// #import resolve::{IMAGE_WORDS}
// #import resolve_*::{sample_color}

override SAMPLES_ACROSS: u32;
override SAMPLES_DOWN: u32;

@compute @workgroup_size(WORKGROUP)
fn resolve(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let tile = covered_tile(workgroup.y * workgroups.x + workgroup.x);
    let size = vec2<u32>(TILE_WIDTH / SAMPLES_ACROSS, TILE_ROWS / SAMPLES_DOWN);
    let first = vec2<u32>(tile % tiles_across(), tile / tiles_across()) * vec2<u32>(TILE_WIDTH, TILE_ROWS);
    for (var k = local; k < size.x * size.y; k += WORKGROUP) {
        let corner = first + vec2<u32>(k % size.x * SAMPLES_ACROSS, k / size.x * SAMPLES_DOWN);
        if (tile < tiles_in_band() && corner.x < held.width && corner.y < held_band.rows) {
            var sum = vec4<f32>(0.0);
            for (var i = 0u; i < SAMPLES_ACROSS; i++) {
                var column = vec4<f32>(0.0);
                for (var j = 0u; j < SAMPLES_DOWN; j++) {
                    let sample = (corner.y + j) * held.width + corner.x + i;
                    column += sample_color(sample, sample, corner.x + i, corner.y + j);
                }
                sum += column;
            }
            write_mean(corner, sum);
        }
    }
}

// Writes the colour of a pixel, straight, from the sum of its samples' premultiplied colours.
// `corner` is the first sample's column and row in the band.
fn write_mean(corner: vec2<u32>, sum: vec4<f32>) {
    let pixel = corner.y / SAMPLES_DOWN * (held.width / SAMPLES_ACROSS) + corner.x / SAMPLES_ACROSS;
    let straight = select(vec3<f32>(0.0), sum.rgb / sum.a, sum.a > 0.0);
    write_color(pixel * IMAGE_WORDS, vec4<f32>(straight, sum.a / f32(SAMPLES_ACROSS * SAMPLES_DOWN)));
}
