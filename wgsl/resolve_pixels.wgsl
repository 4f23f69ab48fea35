// Where each pixel has one sample: its colour and maps. One invocation a pixel of a covered tile. Twin: src/passes/resolve.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xfe0aad96954b729a

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
    let weight = shown_weight(sums_of, front);
    if (weight == 0.0) {
        write_color(out, held.background);
        write_normal(out, vec3<f32>(0.0));
        write_no_depth(out);
        write_weight(out, 0.0);
        write_count(out, sums_of);
        return;
    }
    let normal = resolve_normal(sums_of, weight, front);
    write_color(out, shown_color(sums_of, weight, normal, x, y));
    write_normal(out, normal);
    write_depth(out, sums_of, weight, front);
    write_weight(out, weight_at(sums_of));
    write_count(out, sums_of);
}
