// Textured surfels: the sums of their texture coordinates, and the lookup at the mean coordinates
// of a pixel (textures.wgsl). Same interface as texture_absent.wgsl.
// Twin: src/scene/texture.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x37656be3471cf966
// #import *::{Term, add, add_pair, sum_at, term}
// #import camera_*::{seen_at}
// #import camera_orthographic|perspective::{area_in_pixel}
// #import color_textured::{color_part}
// #import layout::{held, held_band}
// #import textures::{seen_texture}
// #import vectors::{cross3, dot2, dot3}
// #import words|words_long::{surfel_at}

override PLACE_CHANNEL: u32;

// Texture coordinates, in units of their range.
struct Place {
    // The coordinates of the surfel's centre, mapped to [0, 1].
    center: vec2<f32>,
    // The squared reach, mapped to [0, 1]. The reach is how much the coordinates of overlapping
    // surfels may differ at a pixel if they belong to one piece of the texture
    // (src/scene/texture.rs).
    reach_2: f32,
    // The position of the centre relative to the eye, device units.
    position: vec3<f32>,
    // The change of u and of v per world unit along each axis.
    u_slope: vec3<f32>,
    v_slope: vec3<f32>,
}

fn place_of(index: u32) -> Place {
    let center = surfel_at(index).center;
    let at = color_part(index, 1u);
    let u_slope = color_part(index, 2u);
    let v_slope = color_part(index, 3u);
    // The last entries of the three vectors are the part of the centre that f32 leaves out.
    let low = vec3<f32>(at.w, u_slope.w, v_slope.w);
    let position = (vec3<f32>(center[0], center[1], center[2]) * held.unit - held.eye.xyz) + (low * held.unit - held.eye_low.xyz);
    return Place(at.xy, at.z, position, u_slope.xyz, v_slope.xyz);
}

// Adds a fragment at the pixel `at` of the image to the sums of `pixel`.
fn accumulate_place(pixel: u32, weight: Term, place: Place, at: vec2<u32>, depth: f32) {
    let point = seen_at(at.x, at.y, depth);
    let step = (point - place.position) * held.world;
    // A low-pass filter draws fragments outside the disk, where coordinates may leave their range.
    let beyond = place.center + vec2<f32>(dot3(step, place.u_slope), dot3(step, place.v_slope));
    let seen = clamp(beyond, vec2<f32>(0.0), vec2<f32>(1.0));
    let offset = seen - 0.5;
    add_pair(pixel, PLACE_CHANNEL, term(weight, seen.x), term(weight, seen.y));
    // For coordinates in [0, 1] the squared distance from the middle is at most 1/2.
    add_pair(pixel, PLACE_CHANNEL + 2u, term(weight, 2.0 * dot2(offset, offset)), term(weight, place.reach_2));
    // The part of the whole texture that a pixel covers. The slopes are converted to device units,
    // so that no square overflows.
    let area = cross3(place.u_slope * held.world, place.v_slope * held.world);
    let covered_part = area_in_pixel(area, point, depth) * held.place.z * held.place.z;
    add(pixel, PLACE_CHANNEL + 4u, term(weight, covered_part));
}

// Adds a fragment at a pixel of the band, whose sums are in storage.
fn accumulate_stored_place(pixel: u32, weight: Term, place: Place, depth: f32) {
    let at = vec2<u32>(pixel % held.width, pixel / held.width + held_band.first_row);
    accumulate_place(pixel, weight, place, at, depth);
}

// The cell (column, row) in which a point of the textures' common plane lies.
// Twin: src/scene/atlas.rs.
fn cell_of(place: vec2<f32>) -> vec2<f32> {
    return clamp(floor((place - held.atlas.xy) / held.atlas.z), vec2<f32>(0.0), vec2<f32>(held.atlas.w - 1.0));
}

// The mean texture coordinates of a pixel.
fn mean_place(pixel: u32, weight: f32) -> vec2<f32> {
    let mean = vec2<f32>(sum_at(pixel, PLACE_CHANNEL), sum_at(pixel, PLACE_CHANNEL + 1u)) / weight;
    let place = held.place.xy + (mean - 0.5) * held.place.z;
    return place - cell_of(place) * held.atlas.z;
}

// The premultiplied colour of a pixel: from the texture if the fragments' coordinates agree and lie
// in a texture, else the blended colour.
fn textured(pixel: u32, weight: f32, blended: vec4<f32>) -> vec4<f32> {
    var mean: vec4<f32>;
    for (var k = 0u; k < 4u; k++) {
        mean[k] = sum_at(pixel, PLACE_CHANNEL + k) / weight;
    }
    let offset = mean.xy - 0.5;
    let variance = 0.5 * mean.z - dot2(offset, offset);
    let share = clamp(2.0 - variance / (mean.w * held.place.w), 0.0, 1.0);
    let place = held.place.xy + offset * held.place.z;
    let covered_part = sum_at(pixel, PLACE_CHANNEL + 4u) / weight;
    let cell = cell_of(place);
    let number = u32(cell.y * held.atlas.w + cell.x);
    let exists = number < held.textures;
    let seen = seen_texture(select(0u, number, exists), place - cell * held.atlas.z, covered_part);
    return blended + select(0.0, share, exists) * (seen - blended);
}
