// A pixel that shows its nearest surface alone: the mean of what is summed, or a triangle. Same interface as resolve_lists.wgsl.
// Twin: src/passes/resolve.rs.

// What a pixel shows.
struct Surface {
    // Straight.
    color: vec4<f32>,
    normal: vec3<f32>,
    // Camera-space z, device units.
    depth: f32,
    // Summed, and how many fragments that is of, and their mean place in a texture, as far as maps ask for them; of a triangle 1, 1 and none.
    weight: f32,
    count: f32,
    place: vec2<f32>,
    // The depth of the nearest fragment.
    front: f32,
    exists: bool,
}

// The summed weight of a pixel, whose sums `sums_of` names: where nothing is, no sum need be read.
fn shown_weight(sums_of: u32, front: f32) -> f32 {
    var weight = 0.0;
    if (bitcast<u32>(front) != NOTHING) {
        show(sums_of);
        weight = sum_at(sums_of, WEIGHT_CHANNEL);
    }
    return weight;
}

// The surface of a pixel's splats, from what `sums_of` names its sums.
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
        surface.place = place_of_sums(sums_of, weight);
    }
    return surface;
}

// The pixel (x, y), the band's `pixel`th, from what `sums_of` names its sums.
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

// The premultiplied colour of the sample in a column and row of the band, its `sample`th, from what `sums_of` names its sums.
fn sample_color(sums_of: u32, sample: u32, x: u32, row: u32) -> vec4<f32> {
    let surface = joined(blended_at(sums_of, sample, x, row + held_band.first_row), sample, x, row);
    var color = held.background;
    if (surface.exists) {
        color = over(surface.color, held.background);
    }
    return premultiplied_sample(color);
}
