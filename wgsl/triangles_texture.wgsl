// Triangles that are painted: the texture at a pixel, as one that covers so many of its texels sees it. Twin: src/scene/mipmap.rs.

// Where each texture's head is; a head has the number of its levels, and of each its width, its height and where its texels are: rows from
// the top, four bytes of sRGB and straight alpha each.
@group(0) @binding(65) var<storage, read> triangle_textures: array<u32>;

// In a triangle's record.
override TRIANGLE_PLACES: u32;

struct Level {
    size: vec2<i32>,
    texels: u32,
}

fn level_at(head: u32, level: u32) -> Level {
    let first = head + 1u + 3u * level;
    let size = vec2<i32>(i32(triangle_textures[first]), i32(triangle_textures[first + 1u]));
    return Level(size, triangle_textures[first + 2u]);
}

fn level_texel(level: Level, column: i32, row: i32) -> vec4<f32> {
    // Both are at least -1 and at most the size.
    let at = (vec2<i32>(column, row) + level.size) % level.size;
    return premultiplied_of(triangle_textures[level.texels + u32(at.y * level.size.x + at.x)]);
}

// Between the middles of texels interpolated, beyond [0, 1] repeated; origin bottom left.
fn level_color(level: Level, place: vec2<f32>) -> vec4<f32> {
    let at = fract(vec2<f32>(place.x, 1.0 - place.y)) * vec2<f32>(level.size) - 0.5;
    let low = floor(at);
    let share = at - low;
    let column = i32(low.x);
    let row = i32(low.y);
    let above = mix(level_texel(level, column, row), level_texel(level, column + 1, row), share.x);
    let below = mix(level_texel(level, column, row + 1), level_texel(level, column + 1, row + 1), share.x);
    return mix(above, below, share.y);
}

// Premultiplied; a pixel has `spread` of the triangle's parts.
fn triangle_texture(record: u32, parts: vec3<f32>, spread: f32) -> vec4<f32> {
    let first = record + TRIANGLE_PLACES;
    let a = vec2<f32>(triangle_attributes[first], triangle_attributes[first + 1u]);
    let b = vec2<f32>(triangle_attributes[first + 2u], triangle_attributes[first + 3u]);
    let c = vec2<f32>(triangle_attributes[first + 4u], triangle_attributes[first + 5u]);
    // One more than the texture's, 0 of none.
    let number = u32(triangle_attributes[first + 6u]);
    let head = triangle_textures[max(number, 1u) - 1u];
    let whole = level_at(head, 0u);
    let doubled_area = abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
    let texels = spread * doubled_area * f32(whole.size.x) * f32(whole.size.y);
    let last = f32(triangle_textures[head] - 1u);
    let level = min(0.5 * log2(max(texels, 1.0)), last);
    let low = floor(level);
    let place = a + parts.y * (b - a) + parts.z * (c - a);
    let near = level_color(level_at(head, u32(low)), place);
    let far = level_color(level_at(head, u32(min(low + 1.0, last))), place);
    return select(mix(near, far, level - low), vec4<f32>(1.0), number == 0u);
}
