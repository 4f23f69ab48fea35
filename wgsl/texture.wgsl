// Surfels that are painted by a texture: what is summed of their places in it, and its lookup at the mean of these.
// Twin: src/scene/texture.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x68b6005fcfd57619

override PLACE_CHANNEL: u32;

// Rows from the top, four bytes of sRGB and straight alpha each.
@group(0) @binding(36) var<storage, read> texels: array<u32>;

// Texture coordinates are in units of their range.
struct Place {
    // Of the surfel's centre, mapped to [0, 1].
    center: vec2<f32>,
    // Mapped to [0, 1] from its own range.
    reach_2: f32,
    // The centre itself, relative to the eye, device units.
    position: vec3<f32>,
    // What the coordinates gain for a world unit along each axis.
    u_slope: vec3<f32>,
    v_slope: vec3<f32>,
}

fn place_of(index: u32) -> Place {
    let center = surfel_at(index).center;
    let at = color_part(index, 1u);
    let u_slope = color_part(index, 2u);
    let v_slope = color_part(index, 3u);
    // What the f32 centre leaves out comes last in each.
    let low = vec3<f32>(at.w, u_slope.w, v_slope.w);
    let position = (vec3<f32>(center[0], center[1], center[2]) * held.unit - held.eye.xyz) + (low * held.unit - held.eye_low.xyz);
    return Place(at.xy, at.z, position, u_slope.xyz, v_slope.xyz);
}

fn accumulate_place(pixel: u32, weight: Term, place: Place, depth: f32) {
    let point = seen_at(pixel % held.width, pixel / held.width + held_band.first_row, depth);
    let step = (point - place.position) * held.world;
    let at = place.center + vec2<f32>(dot(step, place.u_slope), dot(step, place.v_slope));
    let offset = at - 0.5;
    add_pair(pixel, PLACE_CHANNEL, term(weight, at.x), term(weight, at.y));
    // Of coordinates in [0, 1] the squared distance from the middle is at most 1/2.
    add_pair(pixel, PLACE_CHANNEL + 2u, term(weight, 2.0 * dot(offset, offset)), term(weight, place.reach_2));
}

fn texel(column: i32, row: i32) -> vec4<f32> {
    let size = vec2<i32>(i32(held.texture_width), i32(held.texture_height));
    // Both are at least -1 and at most the size.
    let at = (vec2<i32>(column, row) + size) % size;
    return premultiplied_of(texels[at.y * size.x + at.x]);
}

// Premultiplied linear colour at texture coordinates, origin bottom left: between the middles of texels interpolated, beyond
// [0, 1] repeated.
fn texture_at(place: vec2<f32>) -> vec4<f32> {
    let turns = vec2<f32>(place.x, 1.0 - place.y);
    let at = fract(turns) * vec2<f32>(f32(held.texture_width), f32(held.texture_height)) - 0.5;
    let low = floor(at);
    let share = at - low;
    let column = i32(low.x);
    let row = i32(low.y);
    let above = mix(texel(column, row), texel(column + 1, row), share.x);
    let below = mix(texel(column, row + 1), texel(column + 1, row + 1), share.x);
    return mix(above, below, share.y);
}

// The mean texture coordinates of a pixel.
fn mean_place(pixel: u32, weight: f32) -> vec2<f32> {
    let mean = vec2<f32>(sum_at(pixel, PLACE_CHANNEL), sum_at(pixel, PLACE_CHANNEL + 1u)) / weight;
    return held.place.xy + (mean - 0.5) * held.place.z;
}

// The premultiplied colour of a pixel: by the texture where the places agree, else as blended.
fn textured(pixel: u32, weight: f32, blended: vec4<f32>) -> vec4<f32> {
    var mean: vec4<f32>;
    for (var k = 0u; k < 4u; k++) {
        mean[k] = sum_at(pixel, PLACE_CHANNEL + k) / weight;
    }
    let offset = mean.xy - 0.5;
    let variance = 0.5 * mean.z - dot(offset, offset);
    let share = clamp(2.0 - variance / (mean.w * held.place.w), 0.0, 1.0);
    return blended + share * (texture_at(held.place.xy + offset * held.place.z) - blended);
}
