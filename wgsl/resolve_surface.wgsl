// A pixel that shows its nearest surface alone: the mean of what is summed. Same interface as resolve_lists.wgsl.
// Twin: src/passes/resolve.rs.

// The summed weight of a pixel, whose sums `sums_of` names: where nothing is, no sum need be read.
fn shown_weight(sums_of: u32, front: f32) -> f32 {
    var weight = 0.0;
    if (bitcast<u32>(front) != NOTHING) {
        weight = sum_at(sums_of, WEIGHT_CHANNEL);
    }
    return weight;
}

// The straight colour and alpha of a surface, from what `sums_of` names its sums.
fn surface_color(sums_of: u32, weight: f32, normal: vec3<f32>, x: u32, y: u32) -> vec4<f32> {
    let color = shaded(textured(sums_of, weight, resolve_color(sums_of, weight)), normal, x, y);
    return with_held_back(color, sums_of, weight);
}

// The pixel (x, y), the band's `pixel`th, from what `sums_of` names its sums.
fn resolve_pixel(sums_of: u32, pixel: u32, x: u32, y: u32) {
    let out = pixel * IMAGE_WORDS;
    let front = front_at(pixel);
    let weight = shown_weight(sums_of, front);
    if (weight == 0.0) {
        write_color(out, held.background);
        write_normal(out, vec3<f32>(0.0));
        write_no_depth(out);
        write_weight(out, 0.0);
        write_count(out, sums_of);
        write_transmittance(out, 1.0);
        write_layers(out, 0u);
        write_tail(out, 0.0);
        return;
    }
    let normal = resolve_normal(sums_of, weight, front);
    let color = surface_color(sums_of, weight, normal, x, y);
    write_color(out, over(color, held.background));
    write_normal(out, normal);
    write_depth(out, sums_of, weight, front);
    write_weight(out, weight_at(sums_of));
    write_count(out, sums_of);
    write_transmittance(out, 1.0 - color.a);
    write_layers(out, 1u);
    write_tail(out, 0.0);
}

// The premultiplied colour of the sample in a column and row of the band, its `sample`th, from what `sums_of` names its sums.
fn sample_color(sums_of: u32, sample: u32, x: u32, row: u32) -> vec4<f32> {
    let front = front_at(sample);
    let weight = shown_weight(sums_of, front);
    var color = held.background;
    if (weight != 0.0) {
        let normal = resolve_normal(sums_of, weight, front);
        color = over(surface_color(sums_of, weight, normal, x, row + held_band.first_row), held.background);
    }
    return premultiplied_sample(color);
}
