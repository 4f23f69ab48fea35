// Converts pixels of an image to the texels of a texture, in rows from which the texture is copied.
// Host side: src/render/texture.rs.

// The pixels of a band, as resolve wrote them.
@group(0) @binding(0) var<storage, read> frame_words: array<u32>;
@group(0) @binding(1) var<storage, read_write> texture_rows: array<u32>;
// Eight words (below); then the least linear values of the sRGB codes from 1 to 255, a word of
// padding, and the least values of the plain codes from 1 to 255.
@group(0) @binding(2) var<storage, read> texture_shape: array<u32>;

// Words of `texture_shape`: the pixels of a row, the number of pixels, the words of a pixel, the
// first word of a pixel's value, the words of a row of texels, and the kind of a texel.
const SHAPE_WIDTH: u32 = 0u;
const SHAPE_PIXELS: u32 = 1u;
const SHAPE_STRIDE: u32 = 2u;
const SHAPE_FIRST: u32 = 3u;
const SHAPE_ROW: u32 = 4u;
const SHAPE_TEXEL: u32 = 5u;
// Where the table of colours' codes and that of alpha's start.
const SHAPE_COLOR_CODES: u32 = 6u;
const SHAPE_ALPHA_CODES: u32 = 7u;

// Kinds of texels: bytes of red, green, blue and alpha; the same with red and blue exchanged; four
// f16; four f32; one f32.
const TEXEL_RGBA8: u32 = 0u;
const TEXEL_BGRA8: u32 = 1u;
const TEXEL_RGBA16: u32 = 2u;
const TEXEL_RGBA32: u32 = 3u;

// Returns `code + step` if the value reaches that code, else `code`.
fn code_from(table: u32, value: f32, code: u32, step: u32) -> u32 {
    let least = bitcast<f32>(texture_shape[table + code + step - 1u]);
    return select(code, code + step, least <= value);
}

// The nearest 8-bit code of a value; 0 for NaN.
fn texel_code(table: u32, value: f32) -> u32 {
    let two = code_from(table, value, code_from(table, value, 0u, 128u), 64u);
    let four = code_from(table, value, code_from(table, value, two, 32u), 16u);
    let six = code_from(table, value, code_from(table, value, four, 8u), 4u);
    return code_from(table, value, code_from(table, value, six, 2u), 1u);
}

const TEXELS: u32 = 64u;

// The bits of the nearest f16, ties to even.
fn half_of(bits: u32) -> u32 {
    let sign = (bits >> 16u) & 0x8000u;
    let size = bits & 0x7fffffffu;
    if (size >= 0x47800000u) {
        return sign | select(0x7c00u, 0x7e00u, size > 0x7f800000u);
    }
    // Below 2^-14 an f16 counts units of 2^-24, so the mantissa is shifted by its exponent.
    let small = size < 0x38800000u;
    let shift = select(13u, min(126u - (size >> 23u), 25u), small);
    let mantissa = select(size - 0x38000000u, (size & 0x7fffffu) | 0x800000u, small);
    let half = mantissa >> shift;
    let rest = mantissa & ((1u << shift) - 1u);
    let middle = 1u << (shift - 1u);
    return sign | (half + select(0u, 1u, rest > middle || (rest == middle && (half & 1u) == 1u)));
}

@compute @workgroup_size(TEXELS)
fn write_texture_rows(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    let pixel = (workgroup.y * workgroups.x + workgroup.x) * TEXELS + local;
    if (pixel >= texture_shape[SHAPE_PIXELS]) {
        return;
    }
    let width = texture_shape[SHAPE_WIDTH];
    let first = pixel * texture_shape[SHAPE_STRIDE] + texture_shape[SHAPE_FIRST];
    let row = pixel / width * texture_shape[SHAPE_ROW];
    let column = pixel % width;
    let kind = texture_shape[SHAPE_TEXEL];
    if (kind > TEXEL_RGBA32) {
        texture_rows[row + column] = frame_words[first];
        return;
    }
    let words = vec4<u32>(frame_words[first], frame_words[first + 1u], frame_words[first + 2u], frame_words[first + 3u]);
    let color = bitcast<vec4<f32>>(words);
    if (kind == TEXEL_RGBA32) {
        texture_rows[row + 4u * column] = words.x;
        texture_rows[row + 4u * column + 1u] = words.y;
        texture_rows[row + 4u * column + 2u] = words.z;
        texture_rows[row + 4u * column + 3u] = words.w;
    } else if (kind == TEXEL_RGBA16) {
        texture_rows[row + 2u * column] = half_of(words.x) | (half_of(words.y) << 16u);
        texture_rows[row + 2u * column + 1u] = half_of(words.z) | (half_of(words.w) << 16u);
    } else {
        let table = texture_shape[SHAPE_COLOR_CODES];
        let rgb = vec3<u32>(texel_code(table, color.x), texel_code(table, color.y), texel_code(table, color.z));
        let ordered = select(rgb, rgb.zyx, kind == TEXEL_BGRA8);
        let alpha = texel_code(texture_shape[SHAPE_ALPHA_CODES], color.w);
        texture_rows[row + column] = ordered.x | (ordered.y << 8u) | (ordered.z << 16u) | (alpha << 24u);
    }
}
