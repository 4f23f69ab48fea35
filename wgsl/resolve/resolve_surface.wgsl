// Resolves a pixel that shows only its nearest surface: the mean of the pixel's sums, or a
// triangle. Same interface as resolve_lists.wgsl.
// Twin: src/passes/resolve.rs.
// #import *::{resolve_color, show, sum_at, surface_depth, weight_at}
// #import count::{count_of, write_count}
// #import image_*::{write_color}
// #import individuals::{blended_at}
// #import join::{joined}
// #import layout::{NOTHING, WEIGHT_CHANNEL, held, held_band}
// #import maps::{write_depth, write_layers, write_no_depth, write_no_texz, write_normal}
// #import maps::{write_tail, write_texz, write_transmittance, write_weight}
// #import normal::{resolve_normal}
// #import oit::{with_held_back}
// #import resolve::{IMAGE_WORDS, over, premultiplied_sample, shaded}
// #import texture::{mean_place, textured}

// The surface that a pixel shows.
struct Surface {
    // Straight alpha.
    color: vec4<f32>,
    normal: vec3<f32>,
    // Camera-space z, device units.
    depth: f32,
    // The summed weight, the number of fragments and their mean texture coordinates, each only if a
    // map needs it. A triangle has 1, 1 and (0, 0).
    weight: f32,
    count: f32,
    place: vec2<f32>,
    // The depth of the nearest fragment.
    front: f32,
    exists: bool,
}

// The summed weight at `sums_of` (see surface_of()). The sums of an empty pixel are not read.
fn shown_weight(sums_of: u32, front: f32) -> f32 {
    var weight = 0.0;
    if (bitcast<u32>(front) != NOTHING) {
        show(sums_of);
        weight = sum_at(sums_of, WEIGHT_CHANNEL);
    }
    return weight;
}

// The surface of a pixel's splats. `sums_of` is the index of the pixel's sums: the index of the
// pixel if the sums are in storage, or its slot if they are in a tile's registers (tile_sums.wgsl).
fn surface_of(sums_of: u32, front: f32, x: u32, y: u32) -> Surface {
    var surface: Surface;
    surface.front = front;
    let weight = shown_weight(sums_of, front);
    surface.exists = weight != 0.0;
    if (surface.exists) {
        surface.normal = resolve_normal(sums_of, weight, front);
        let blended = textured(sums_of, weight, resolve_color(sums_of, weight));
        surface.color = with_held_back(shaded(blended, surface.normal, x, y), sums_of, weight);
        surface.depth = surface_depth(sums_of, weight, front);
        surface.weight = weight_at(sums_of);
        surface.count = count_of(sums_of);
        surface.place = mean_place(sums_of, weight);
    }
    return surface;
}

// Resolves the pixel (x, y) of the image, the `pixel`th of the band, from the sums at `sums_of`.
fn resolve_pixel(sums_of: u32, pixel: u32, x: u32, y: u32) {
    let out = pixel * IMAGE_WORDS;
    let surface = joined(blended_at(sums_of, pixel, x, y), pixel, x, y - held_band.first_row);
    write_tail(out, 0.0);
    if (!surface.exists) {
        write_color(out, held.background);
        write_normal(out, vec3<f32>(0.0));
        write_no_depth(out);
        write_no_texz(out);
        write_weight(out, 0.0);
        write_count(out, 0.0);
        write_transmittance(out, 1.0);
        write_layers(out, 0u);
        return;
    }
    write_color(out, over(surface.color, held.background));
    write_normal(out, surface.normal);
    write_depth(out, surface.depth);
    write_texz(out, surface.place, surface.depth);
    write_weight(out, surface.weight);
    write_count(out, surface.count);
    write_transmittance(out, 1.0 - surface.color.a);
    write_layers(out, 1u);
}

// The premultiplied colour of a sample, the `sample`th of the band, at column `x` and row `row` of
// the band.
fn sample_color(sums_of: u32, sample: u32, x: u32, row: u32) -> vec4<f32> {
    let surface = joined(blended_at(sums_of, sample, x, row + held_band.first_row), sample, x, row);
    var color = held.background;
    if (surface.exists) {
        color = over(surface.color, held.background);
    }
    return premultiplied_sample(color);
}
