// The start of stage 4: lists the tiles of the image that are not empty. Empty tiles keep the
// cleared values, and no invocation visits their pixels. Host side: src/passes/covered.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x19e76a958fe8075b
// #import accumulator_raster|front::{visible}
// #import accumulator_raster|occlusion::{covered_start, has_any}
// #import accumulator_raster|visibility::{nearest}
// #import layout::{WORKGROUP, held, held_band, hold, linear_index}
// #import project::{rows_of}
// #import triangles_tiles::{has_triangles}

// The size of a tile, pixels: multiples of OCCLUSION_TILE.
override TILE_WIDTH: u32;
override TILE_ROWS: u32;

// 1 if all tiles are listed, because empty pixels of the image differ from 0 or layers are peeled.
override LIST_EMPTY: u32;
// 1 if inputs are blended separately (individuals.wgsl). For each input only the tiles that it
// covers are then listed here, and list_individuals() lists those of the finished image.
override LIST_APART: u32;

// The list lies in `nearest`, from covered_start() on: the number of listed tiles; a grid with one
// workgroup per tile; a grid with one per eight tiles; and, from COVERED_LIST on, the tiles.
const COVERED_GRID: u32 = 1u;
const COVERED_GRID_OF_EIGHTS: u32 = 4u;
const COVERED_LIST: u32 = 8u;

// The number of tiles in a row of the image.
fn tiles_across() -> u32 {
    return (held.width + TILE_WIDTH - 1u) / TILE_WIDTH;
}

// The number of tiles in the band.
fn tiles_in_band() -> u32 {
    return tiles_across() * ((held_band.rows + TILE_ROWS - 1u) / TILE_ROWS);
}

// One invocation per tile.
@compute @workgroup_size(WORKGROUP)
fn list_covered(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let tile = linear_index(workgroup, workgroups, local);
    let of_others = LIST_APART == 0u && (LIST_EMPTY != 0u || has_triangles(tile));
    if (tile < tiles_in_band() && (of_others || has_any(tile))) {
        // The order of the list depends on the schedule, but tiles share no pixel.
        let place = atomicAdd(&nearest[covered_start()], 1u);
        atomicStore(&nearest[covered_start() + COVERED_LIST + place], tile);
    }
}

@compute @workgroup_size(1)
fn arrange_covered() {
    hold();
    let listed = atomicLoad(&nearest[covered_start()]);
    let grid = rows_of(listed);
    let eighths = rows_of((listed + 7u) / 8u);
    for (var k = 0u; k < 3u; k++) {
        atomicStore(&nearest[covered_start() + COVERED_GRID + k], grid[k]);
        atomicStore(&nearest[covered_start() + COVERED_GRID_OF_EIGHTS + k], eighths[k]);
    }
}

// The tile at a place of the list; past its end, a number that is no tile.
fn covered_tile(place: u32) -> u32 {
    return select(0xffffffffu, visible[covered_start() + COVERED_LIST + place], place < visible[covered_start()]);
}
