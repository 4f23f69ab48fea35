// A pixel that shows its nearest surface alone: the mean of what is summed, or a triangle. Same interface as resolve_lists.wgsl.
// Twin: src/passes/resolve.rs.

// What a pixel shows.
struct Surface {
    // Straight.
    color: vec4<f32>,
    normal: vec3<f32>,
    // Camera-space z, device units.
    depth: f32,
    // Summed, if it is of splats.
    weight: f32,
    exists: bool,
    // A triangle's alone.
    of_triangle: bool,
}

// The summed weight of a pixel, whose sums `sums_of` names: where nothing is, no sum need be read.
fn shown_weight(sums_of: u32, front: f32) -> f32 {
    var weight = 0.0;
    if (bitcast<u32>(front) != NOTHING) {
        weight = sum_at(sums_of, WEIGHT_CHANNEL);
    }
    return weight;
}

// The surface of a pixel's splats, from what `sums_of` names its sums.
fn surface_of(sums_of: u32, front: f32, x: u32, y: u32) -> Surface {
    var surface: Surface;
    surface.weight = shown_weight(sums_of, front);
    surface.exists = surface.weight != 0.0;
    if (surface.exists) {
        surface.normal = resolve_normal(sums_of, surface.weight, front);
        let blended = textured(sums_of, surface.weight, resolve_color(sums_of, surface.weight));
        surface.color = with_held_back(shaded(blended, surface.normal, x, y), sums_of, surface.weight);
        surface.depth = surface_depth(sums_of, surface.weight, front);
    }
    return surface;
}

// The pixel (x, y), the band's `pixel`th, from what `sums_of` names its sums.
fn resolve_pixel(sums_of: u32, pixel: u32, x: u32, y: u32) {
    let out = pixel * IMAGE_WORDS;
    let front = front_at(pixel);
    let surface = joined(surface_of(sums_of, front, x, y), pixel, front);
    write_tail(out, 0.0);
    if (!surface.exists) {
        write_color(out, held.background);
        write_normal(out, vec3<f32>(0.0));
        write_no_depth(out);
        write_no_texz(out);
        write_weight(out, 0.0);
        write_count(out, sums_of);
        write_transmittance(out, 1.0);
        write_layers(out, 0u);
        return;
    }
    write_color(out, over(surface.color, held.background));
    write_normal(out, surface.normal);
    write_depth(out, surface.depth);
    write_texz(out, sums_of, select(surface.weight, 0.0, surface.of_triangle), surface.depth);
    if (surface.of_triangle) {
        write_weight(out, 1.0);
        write_one(out);
    } else {
        write_weight(out, weight_at(sums_of));
        write_count(out, sums_of);
    }
    write_transmittance(out, 1.0 - surface.color.a);
    write_layers(out, 1u);
}

// The premultiplied colour of the sample in a column and row of the band, its `sample`th, from what `sums_of` names its sums.
fn sample_color(sums_of: u32, sample: u32, x: u32, row: u32) -> vec4<f32> {
    let front = front_at(sample);
    let surface = joined(surface_of(sums_of, front, x, row + held_band.first_row), sample, front);
    var color = held.background;
    if (surface.exists) {
        color = over(surface.color, held.background);
    }
    return premultiplied_sample(color);
}
