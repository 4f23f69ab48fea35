// Inputs that are blended separately, the individuals of Tien 2008. They are drawn one after the
// other, and each pixel keeps the nearest of their blended surfaces, compared by blended depth
// (section 5.3). Twin: src/passes/individuals.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xc8e03ae27b9173ec
// #import *::{front_at}
// #import covered::{LIST_EMPTY, TILE_ROWS, TILE_WIDTH, covered_tile, list_tile, tiles_across}
// #import covered::{tiles_in_band}
// #import layout::{WORKGROUP, held, held_band, hold, linear_index}
// #import resolve_surface::{Surface, surface_of}
// #import triangles_tiles::{has_triangles}

// Per pixel: the straight colour, shaded; then the normal (world space, unit length) and the depth
// (device units, 0 if empty). Where joins or maps need them, two more vectors follow: the depth of
// the nearest fragment, the summed weight and the number of fragments; then the texture
// coordinates.
@group(0) @binding(68) var<storage, read_write> individuals: array<vec4<f32>>;

override INDIVIDUAL_VECTORS: u32;

fn kept_surface(pixel: u32) -> Surface {
    let first = pixel * INDIVIDUAL_VECTORS;
    let placed = individuals[first + 1u];
    var kept: Surface;
    kept.color = individuals[first];
    kept.normal = placed.xyz;
    kept.depth = placed.w;
    kept.exists = placed.w != 0.0;
    if (INDIVIDUAL_VECTORS > 2u) {
        let summed = individuals[first + 2u];
        kept.front = summed.x;
        kept.weight = summed.y;
        kept.count = summed.z;
        kept.place = individuals[first + 3u].xy;
    }
    return kept;
}

fn keep_surface(pixel: u32, surface: Surface) {
    let first = pixel * INDIVIDUAL_VECTORS;
    individuals[first] = surface.color;
    individuals[first + 1u] = vec4<f32>(surface.normal, surface.depth);
    if (INDIVIDUAL_VECTORS > 2u) {
        individuals[first + 2u] = vec4<f32>(surface.front, surface.weight, surface.count, 0.0);
        individuals[first + 3u] = vec4<f32>(surface.place, 0.0, 0.0);
    }
}

// The order of two colours: the sign of their first difference, or 0 if they are equal.
fn order_of(a: vec4<f32>, b: vec4<f32>) -> f32 {
    var order = 0.0;
    for (var k = 0u; k < 4u; k++) {
        order = select(order, sign(a[k] - b[k]), order == 0.0);
    }
    return order;
}

// Whether a is shown in place of b: a is nearer or, at equal depth, greater in the first value that
// differs. So the order of the inputs is never visible.
fn shows_before(a: Surface, b: Surface) -> bool {
    let by_color = order_of(a.color, b.color);
    let by_normal = order_of(vec4<f32>(a.normal, a.weight), vec4<f32>(b.normal, b.weight));
    let by_rest = order_of(vec4<f32>(a.place, a.count, a.front), vec4<f32>(b.place, b.count, b.front));
    let by_value = select(select(by_rest, by_normal, by_normal != 0.0), by_color, by_color != 0.0);
    let is_before = select((a.depth < b.depth), (by_value > 0.0), a.depth == b.depth);
    return a.exists && (!b.exists || is_before);
}

// Keeps an individual's surface at the pixel (x, y), the `pixel`th of the band, if it is the
// nearest so far.
fn keep_nearest_of(sums_of: u32, pixel: u32, x: u32, y: u32) {
    let surface = surface_of(sums_of, front_at(pixel), x, y);
    if (shows_before(surface, kept_surface(pixel))) {
        keep_surface(pixel, surface);
    }
}

// Runs after an individual is summed. One workgroup per tile that the individual covers.
@compute @workgroup_size(WORKGROUP)
fn keep_individual(
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
            keep_nearest_of(pixel, pixel, x, y + held_band.first_row);
        }
    }
}

// Runs after all individuals: lists the tiles in which any individual or triangle shows. One
// invocation per tile.
@compute @workgroup_size(WORKGROUP)
fn list_individuals(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let tile = linear_index(workgroup, workgroups, local);
    let first = vec2<u32>(tile % tiles_across() * TILE_WIDTH, tile / tiles_across() * TILE_ROWS);
    var any_shows = LIST_EMPTY != 0u;
    for (var k = 0u; k < TILE_WIDTH * TILE_ROWS; k++) {
        let at = first + vec2<u32>(k % TILE_WIDTH, k / TILE_WIDTH);
        if (at.x < held.width && at.y < held_band.rows) {
            any_shows = any_shows || individuals[(at.y * held.width + at.x) * INDIVIDUAL_VECTORS + 1u].w != 0.0;
        }
    }
    list_tile(tile, tile < tiles_in_band() && (any_shows || has_triangles(tile)), local);
}

// The surface of a pixel's splats.
fn blended_at(sums_of: u32, pixel: u32, x: u32, y: u32) -> Surface {
    return kept_surface(pixel);
}
