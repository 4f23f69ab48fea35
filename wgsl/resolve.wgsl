// Stage 4: sums become the image: divide by the weight, shade, put over the background. One invocation a pixel of a covered
// tile. Twin: src/passes/resolve.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xe1c75122e1e62e05

// Words of a pixel in the image (image_*.wgsl); the colour's four come first.
override IMAGE_WORDS: u32;

// Straight alpha over straight alpha.
fn over(front: vec4<f32>, back: vec4<f32>) -> vec4<f32> {
    let behind = back.a * (1.0 - front.a);
    let alpha = front.a + behind;
    return select(vec4<f32>(0.0), vec4<f32>((front.rgb * front.a + back.rgb * behind) / alpha, alpha), alpha > 0.0);
}

// One workgroup a covered tile.
@compute @workgroup_size(WORKGROUP)
fn resolve(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let tile = covered_tile(workgroup.y * workgroups.x + workgroup.x);
    let x = tile % tiles_across() * TILE_WIDTH + local % TILE_WIDTH;
    for (var row = 0u; row < TILE_ROWS; row += WORKGROUP / TILE_WIDTH) {
        let y = tile / tiles_across() * TILE_ROWS + row + local / TILE_WIDTH;
        if (tile < tiles_in_band() && x < held.width && y < held_band.rows) {
            let pixel = y * held.width + x;
            show(pixel);
            resolve_pixel(pixel, pixel, x, y + held_band.first_row);
        }
    }
}

// The pixel (x, y), the band's `pixel`th, from what `sums_of` names its sums.
fn resolve_pixel(sums_of: u32, pixel: u32, x: u32, y: u32) {
    let out = pixel * IMAGE_WORDS;
    let front = front_at(pixel);
    // Where nothing is, no sum need be read.
    var weight = 0.0;
    if (bitcast<u32>(front) != NOTHING) {
        weight = sum_at(sums_of, WEIGHT_CHANNEL);
    }
    if (weight == 0.0) {
        write_color(out, held.background);
        write_normal(out, vec3<f32>(0.0));
        write_no_depth(out);
        write_weight(out, 0.0);
        write_count(out, sums_of);
        return;
    }
    let premultiplied = textured(sums_of, weight, resolve_color(sums_of, weight));
    let alpha = premultiplied.a;
    let color = select(vec3<f32>(0.0), premultiplied.rgb / alpha, alpha > 0.0);
    let normal = resolve_normal(sums_of, weight);
    write_color(out, over(vec4<f32>(shade(color, normal, x, y), alpha), held.background));
    write_normal(out, normal);
    write_depth(out, sums_of, weight, front);
    write_weight(out, weight_at(sums_of));
    write_count(out, sums_of);
}
