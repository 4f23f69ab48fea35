// Mipmapped textures: the lookup for a pixel that covers a part of a texture.
// Twin: src/scene/mipmap.rs.
// #import srgb::{premultiplied_of}
// #import vectors::{between}

// First, for each texture, the word at which its header starts (textures of surfels before those of
// triangles); then headers and texels. A header has the number of levels and, for each, its width,
// its height and where its texels start: rows from the top, four bytes of sRGB and straight alpha
// per texel.
@group(0) @binding(65) var<storage, read> textures: array<u32>;

struct Level {
    size: vec2<i32>,
    texels: u32,
    // Whether coordinates outside [0, 1] take the edge texels; otherwise the image repeats.
    clamps: bool,
}

// The flag for clamped edges, in the highest bit of a width.
const CLAMPS: u32 = 0x80000000u;

fn level_at(head: u32, level: u32) -> Level {
    let first = head + 1u + 3u * level;
    let size = vec2<i32>(i32(textures[first] & ~CLAMPS), i32(textures[first + 1u]));
    return Level(size, textures[first + 2u], (textures[first] & CLAMPS) != 0u);
}

fn level_texel(level: Level, column: i32, row: i32) -> vec4<f32> {
    // Column and row are at least -1 and at most the size.
    let given = vec2<i32>(column, row);
    let at = select((given + level.size) % level.size, clamp(given, vec2<i32>(0), level.size - 1), level.clamps);
    return premultiplied_of(textures[level.texels + u32(at.y * level.size.x + at.x)]);
}

// The bilinear colour at `place`, origin bottom left: premultiplied, linear. Outside [0, 1] the
// image repeats, or takes its edge texels.
fn level_color(level: Level, place: vec2<f32>) -> vec4<f32> {
    let turns = vec2<f32>(place.x, 1.0 - place.y);
    let within = select(fract(turns), clamp(turns, vec2<f32>(0.0), vec2<f32>(1.0)), level.clamps);
    let at = within * vec2<f32>(level.size) - 0.5;
    let low = floor(at);
    let share = at - low;
    let column = i32(low.x);
    let row = i32(low.y);
    let above = between(level_texel(level, column, row), level_texel(level, column + 1, row), share.x);
    let below = between(level_texel(level, column, row + 1), level_texel(level, column + 1, row + 1), share.x);
    return between(above, below, share.y);
}

// The colour of texture `number` at `place`, for a pixel that covers a `part` of the whole texture:
// interpolated between the two levels whose texels are the next smaller and the next larger than
// the covered area.
fn seen_texture(number: u32, place: vec2<f32>, part: f32) -> vec4<f32> {
    let head = textures[number];
    let whole = level_at(head, 0u);
    let texels = part * f32(whole.size.x) * f32(whole.size.y);
    let last = f32(textures[head] - 1u);
    let level = min(0.5 * log2(max(texels, 1.0)), last);
    let low = floor(level);
    let near = level_color(level_at(head, u32(low)), place);
    let far = level_color(level_at(head, u32(min(low + 1.0, last))), place);
    return between(near, far, level - low);
}
