// Triangles, their attribute pass: what the nearest one of each pixel shows there. One workgroup a tile in which any shows. Twin: src/passes/triangles.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xccb9f67a456abcdd

// A record a triangle: its corners' normals, if it has some, then their premultiplied colours, then their places in a texture and its number. If all
// have one colour, that is before the
// records, and in none.
@group(0) @binding(60) var<storage, read> triangle_attributes: array<f32>;
// What triangles show at a pixel: the straight colour, shaded; then the normal, world space, unit, and the depth, camera-space z in device
// units, 0 where nothing is. Then what triangles_tiles.wgsl tells of tiles.
@group(0) @binding(61) var<storage, read_write> triangle_pixels: array<vec4<f32>>;

// Words of a record; of its normals; and before the first one.
override TRIANGLE_WORDS: u32;
override TRIANGLE_COLORS: u32;
override TRIANGLE_RECORDS: u32;
override TRIANGLE_NORMALS: bool;
override TRIANGLE_COLORED: bool;

fn triangle_vector(word: u32) -> vec3<f32> {
    return vec3<f32>(triangle_attributes[word], triangle_attributes[word + 1u], triangle_attributes[word + 2u]);
}

// World space, as long as it comes.
fn normal_of_triangle(number: u32, triangle: Triangle, parts: vec3<f32>) -> vec3<f32> {
    if (!TRIANGLE_NORMALS) {
        return facet_of(triangle.numbers);
    }
    let first = TRIANGLE_RECORDS + number * TRIANGLE_WORDS;
    let mean = parts.x * triangle_vector(first) + parts.y * triangle_vector(first + 3u);
    return mean + parts.z * triangle_vector(first + 6u);
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
    // Lengths of facets are squares of small ones.
    let long = normal_of_triangle(number, triangle, crossed.parts);
    let scaled = long / max(max(abs(long.x), abs(long.y)), max(abs(long.z), 1e-38));
    let normal = scaled * inverseSqrt(max(dot3(scaled, scaled), 1e-12));
    let record = TRIANGLE_RECORDS + number * TRIANGLE_WORDS;
    let painted = color_of_triangle(number, crossed.parts) * triangle_texture(record, crossed.parts, crossed.spread);
    triangle_pixels[2u * pixel] = shaded(painted, normal, x, y);
    triangle_pixels[2u * pixel + 1u] = vec4<f32>(normal, crossed.depth);
}
