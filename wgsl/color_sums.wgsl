// Premultiplied linear colour, each channel mapped from the scene's range to [0, 1] before it is summed.
// Twin: src/passes/accumulate.rs, src/passes/resolve.rs.

override COLOR_WORD: u32;
// 3, or 4 where alpha varies.
override COLOR_CHANNELS: u32;

fn in_range(premultiplied: vec4<f32>) -> vec4<f32> {
    return (premultiplied - view.color_low) * view.color_scale;
}

fn accumulate_color(word: u32, weight: u32, color: vec4<f32>) {
    for (var k = 0u; k < COLOR_CHANNELS; k++) {
        add(word + COLOR_WORD + k * SUM_WORDS, term(weight, color[k]));
    }
}

fn resolve_color(word: u32, weight: f32) -> vec4<f32> {
    var mean = vec4<f32>(0.0);
    for (var k = 0u; k < COLOR_CHANNELS; k++) {
        mean[k] = sum_at(word + COLOR_WORD + k * SUM_WORDS) / weight;
    }
    return view.color_low + view.color_span * mean;
}
