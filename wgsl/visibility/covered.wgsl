// The start of stage 4: lists the tiles of the image that are not empty. Empty tiles keep the
// cleared values, and no invocation visits their pixels. occlude(), list_individuals() and
// list_covered() of the rasteriser find the tiles. Host side: src/passes/covered.rs.
// #import accumulator_raster|front::{visible}
// #import accumulator_raster|occlusion::{covered_start}
// #import accumulator_raster|visibility::{nearest}
// #import layout::{held, held_band}
// #import project::{MOST_GROUPS}
// #import triangles_tiles::{has_triangles}

// The size of a tile, pixels: multiples of OCCLUSION_TILE.
override TILE_WIDTH: u32;
override TILE_ROWS: u32;

// 1 if all tiles are listed, because empty pixels of the image differ from 0 or layers are peeled.
override LIST_EMPTY: u32;
// 1 if inputs are blended separately (individuals.wgsl). For each input only the tiles that it
// covers are then listed first, and list_individuals() lists those of the finished image.
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

// Whether a tile is listed even if it has no fragment.
fn is_always_listed(tile: u32) -> bool {
    return LIST_APART == 0u && (LIST_EMPTY != 0u || has_triangles(tile));
}

// Workgroups in a row of the grids. If one row cannot have all tiles, rows are short, so that the
// last one has few spare workgroups.
const SHORT_ROW: u32 = 1024u;

// Makes a grid of `nearest`, from word `first` on, have this number of workgroups at least.
fn grow_grid(first: u32, groups: u32) {
    let row = select(SHORT_ROW, MOST_GROUPS, tiles_in_band() <= MOST_GROUPS);
    atomicMax(&nearest[first], min(groups, row));
    atomicMax(&nearest[first + 1u], (groups + row - 1u) / row);
    atomicStore(&nearest[first + 2u], 1u);
}

var<workgroup> group_listed: atomic<u32>;
var<workgroup> group_place: u32;

// Appends a tile to the list if `listed` is set. All invocations of a workgroup call it together.
// The grids grow with the list, so that no dispatch has to write them. The order of the list
// depends on the schedule, but tiles share no pixel.
fn list_tile(tile: u32, listed: bool, local: u32) {
    var rank = 0u;
    if (listed) {
        rank = atomicAdd(&group_listed, 1u);
    }
    workgroupBarrier();
    if (local == 0u) {
        let all_listed = atomicLoad(&group_listed);
        if (all_listed > 0u) {
            group_place = atomicAdd(&nearest[covered_start()], all_listed);
            let end = group_place + all_listed;
            grow_grid(covered_start() + COVERED_GRID, end);
            grow_grid(covered_start() + COVERED_GRID_OF_EIGHTS, (end + 7u) / 8u);
        }
    }
    workgroupBarrier();
    if (listed) {
        atomicStore(&nearest[covered_start() + COVERED_LIST + group_place + rank], tile);
    }
}

// The tile at a place of the list; past its end, a number that is no tile.
fn covered_tile(place: u32) -> u32 {
    return select(0xffffffffu, visible[covered_start() + COVERED_LIST + place], place < visible[covered_start()]);
}
