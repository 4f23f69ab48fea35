// One sample per pixel: writes the pixel's colour and maps (resolve_surface.wgsl,
// resolve_lists.wgsl). Same interface as resolve_samples.wgsl. Twin: src/passes/resolve.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x1cce65108f45b35b
// #import covered::{TILE_ROWS, TILE_WIDTH, covered_tile, tiles_across, tiles_in_band}
// #import layout::{WORKGROUP, held, held_band, hold}
// #import resolve_*::{resolve_pixel}

// One workgroup per covered tile.
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
            resolve_pixel(pixel, pixel, x, y + held_band.first_row);
        }
    }
}
