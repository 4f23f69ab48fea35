// The list of image tiles in which triangles show. Pixels of other tiles are not shaded, nor read
// when splats and triangles are joined. Same interface as triangles_tiles_absent.wgsl.
// Host side: src/passes/triangles.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xe27600bd9fa6ddd4
// #import covered::{TILE_ROWS, TILE_WIDTH, tiles_across}
// #import footprint::{band_pixels}
// #import layout::{WORKGROUP, held, held_band, hold, linear_index}
// #import project::{rows_of}
// #import triangles_*::{nearest_triangle}
// #import triangles_attributes::{triangle_pixels}

// The number of listed tiles, a grid with one workgroup for each, and from TRIANGLE_TILES on the
// tiles, 8 x 8 pixels each. After the pixels, triangle_pixels has a row for each tile of the band,
// which says whether the tile is listed. `tiles_of_triangles` is the same buffer as
// `triangle_tiles`, read-only.
@group(0) @binding(70) var<storage, read_write> triangle_tiles: array<atomic<u32>>;
@group(0) @binding(71) var<storage, read> tiles_of_triangles: array<u32>;
// The same buffer as `triangle_pixels`, read-only. Its pixels are valid in tiles where triangles
// show.
@group(0) @binding(62) var<storage, read> beside: array<vec4<f32>>;

const TRIANGLE_TILES: u32 = 8u;
const TRIANGLE_TILE: u32 = 8u;

fn triangle_tiles_across() -> u32 {
    return (held.width + TRIANGLE_TILE - 1u) / TRIANGLE_TILE;
}

fn triangle_tiles_in_band() -> u32 {
    return triangle_tiles_across() * ((held_band.rows + TRIANGLE_TILE - 1u) / TRIANGLE_TILE);
}

// One invocation per tile.
@compute @workgroup_size(WORKGROUP)
fn list_triangle_tiles(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let tile = linear_index(workgroup, workgroups, local);
    let first = vec2<u32>(tile % triangle_tiles_across(), tile / triangle_tiles_across()) * TRIANGLE_TILE;
    var shows = 0u;
    for (var k = 0u; k < TRIANGLE_TILE * TRIANGLE_TILE; k++) {
        let at = first + vec2<u32>(k % TRIANGLE_TILE, k / TRIANGLE_TILE);
        if (at.x < held.width && at.y < held_band.rows) {
            shows |= nearest_triangle(at.y * held.width + at.x, at.x, at.y + held_band.first_row).y;
        }
    }
    if (tile < triangle_tiles_in_band()) {
        triangle_pixels[2u * band_pixels() + tile] = vec4<f32>(f32(shows));
        if (shows != 0u) {
            // The order of the list depends on the schedule, but tiles share no pixel.
            atomicStore(&triangle_tiles[TRIANGLE_TILES + atomicAdd(&triangle_tiles[0], 1u)], tile);
        }
    }
}

@compute @workgroup_size(1)
fn arrange_triangle_tiles() {
    hold();
    let grid = rows_of(atomicLoad(&triangle_tiles[0]));
    for (var k = 0u; k < 3u; k++) {
        atomicStore(&triangle_tiles[1u + k], grid[k]);
    }
}

// The tile at a place of the list; past its end, a number that is no tile.
fn triangle_tile(place: u32) -> u32 {
    return select(0xffffffffu, tiles_of_triangles[TRIANGLE_TILES + place], place < tiles_of_triangles[0]);
}

fn tile_has_triangles(tile: u32) -> bool {
    return beside[2u * band_pixels() + tile].x != 0.0;
}

// Whether triangles show in the tile of a pixel, at column `x` and row `row` of the band.
fn shows_triangles(x: u32, row: u32) -> bool {
    return tile_has_triangles(row / TRIANGLE_TILE * triangle_tiles_across() + x / TRIANGLE_TILE);
}

// Whether triangles show in a tile of covered.wgsl, which consists of whole tiles of this file.
fn has_triangles(tile: u32) -> bool {
    let across = triangle_tiles_across();
    let size = vec2<u32>(TILE_WIDTH, TILE_ROWS) / TRIANGLE_TILE;
    let first = vec2<u32>(tile % tiles_across(), tile / tiles_across()) * size;
    let end = min(first + size, vec2<u32>(across, triangle_tiles_in_band() / across));
    var shows = false;
    for (var y = first.y; y < end.y; y++) {
        for (var x = first.x; x < end.x; x++) {
            shows = shows || tile_has_triangles(y * across + x);
        }
    }
    return shows;
}
