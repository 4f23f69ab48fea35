// The attribute pass of triangles: shades the nearest triangle of each pixel. One workgroup per
// tile in which a triangle shows. Twin: src/passes/triangles.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xa4de1c68dd8fbf16
// #import camera_*::{ray}
// #import layout::{WORKGROUP, held, held_band, hold}
// #import resolve::{shaded}
// #import triangles::{Triangle, cross_precisely, triangle_at}
// #import triangles_*::{nearest_triangle}
// #import triangles_texture::{triangle_texture}
// #import triangles_tiles::{TRIANGLE_TILE, triangle_tile, triangle_tiles_across}
// #import triangles_tiles::{triangle_tiles_in_band}
// #import vectors::{dot3}
// #import vertex|vertex_doubled::{facet_of}

// A record per triangle: the normals of its corners, their premultiplied colours, and their texture
// coordinates with the texture's number, each only if the mesh has it. If all triangles have the
// same colours, these come once, before the records.
@group(0) @binding(60) var<storage, read> triangle_attributes: array<f32>;
// Two rows per pixel: the straight, shaded colour; then the normal (world space, unit length) and
// the depth (camera-space z in device units, 0 where no triangle is). Then a row per tile
// (triangles_tiles.wgsl).
@group(0) @binding(61) var<storage, read_write> triangle_pixels: array<vec4<f32>>;

// Words of a record, words of its normals, and words before the first record.
override TRIANGLE_WORDS: u32;
override TRIANGLE_COLORS: u32;
override TRIANGLE_RECORDS: u32;
override TRIANGLE_NORMALS: bool;
override TRIANGLE_COLORED: bool;

fn triangle_vector(word: u32) -> vec3<f32> {
    return vec3<f32>(triangle_attributes[word], triangle_attributes[word + 1u], triangle_attributes[word + 2u]);
}

// World space, not normalised.
fn normal_of_triangle(number: u32, triangle: Triangle, parts: vec3<f32>) -> vec3<f32> {
    if (!TRIANGLE_NORMALS) {
        return facet_of(triangle.numbers);
    }
    let first = TRIANGLE_RECORDS + number * TRIANGLE_WORDS;
    let mean = parts.x * triangle_vector(first) + parts.y * triangle_vector(first + 3u);
    return mean + parts.z * triangle_vector(first + 6u);
}

// A vector with length 1, or shorter if it is next to nothing. A facet's normal is as long as a
// product of two edges, which may be short, so it is scaled before it is squared.
fn unit_or_less(long: vec3<f32>) -> vec3<f32> {
    let scaled = long / max(max(abs(long.x), abs(long.y)), max(abs(long.z), 1e-38));
    return scaled * inverseSqrt(max(dot3(scaled, scaled), 1e-12));
}

// The normal by which a triangle is lit. An interpolated normal may point away from the viewer
// although its facet, seen aslant, shows the viewer the same side; then it is turned to the
// horizon, where a headlight is dark. Otherwise it would be lit as if the other side were seen.
fn within_horizon(normal: vec3<f32>, facet: vec3<f32>, toward_eye: vec3<f32>) -> vec3<f32> {
    let facing = dot3(normal, toward_eye);
    if (facing * dot3(facet, toward_eye) * dot3(facet, normal) >= 0.0) {
        return normal;
    }
    return unit_or_less(normal - facing * toward_eye);
}

fn color_of_triangle(number: u32, parts: vec3<f32>) -> vec4<f32> {
    let first = select(0u, number * TRIANGLE_WORDS + TRIANGLE_COLORS, TRIANGLE_COLORED);
    var mean = vec4<f32>(0.0);
    for (var corner = 0u; corner < 3u; corner++) {
        let word = first + 4u * corner;
        mean += parts[corner] * vec4<f32>(triangle_vector(word), triangle_attributes[word + 3u]);
    }
    return mean;
}

@compute @workgroup_size(WORKGROUP)
fn shade_triangles(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold();
    let tile = triangle_tile(workgroup.y * workgroups.x + workgroup.x);
    let x = tile % triangle_tiles_across() * TRIANGLE_TILE + local % TRIANGLE_TILE;
    let row = tile / triangle_tiles_across() * TRIANGLE_TILE + local / TRIANGLE_TILE;
    if (tile >= triangle_tiles_in_band() || x >= held.width || row >= held_band.rows) {
        return;
    }
    let pixel = row * held.width + x;
    let y = row + held_band.first_row;
    let named = nearest_triangle(pixel, x, y);
    if (named.y == 0u) {
        triangle_pixels[2u * pixel + 1u] = vec4<f32>(0.0);
        return;
    }
    let number = named.x;
    let triangle = triangle_at(number);
    let crossed = cross_precisely(triangle, vec2<f32>(f32(x), f32(y)) + 0.5);
    let normal = unit_or_less(normal_of_triangle(number, triangle, crossed.parts));
    let record = TRIANGLE_RECORDS + number * TRIANGLE_WORDS;
    let painted = color_of_triangle(number, crossed.parts) * triangle_texture(record, crossed.parts, crossed.spread);
    var lit_normal = normal;
    if (TRIANGLE_NORMALS) {
        lit_normal = within_horizon(normal, unit_or_less(facet_of(triangle.numbers)), -ray(x, y));
    }
    triangle_pixels[2u * pixel] = shaded(painted, lit_normal, x, y);
    triangle_pixels[2u * pixel + 1u] = vec4<f32>(normal, crossed.depth);
}
