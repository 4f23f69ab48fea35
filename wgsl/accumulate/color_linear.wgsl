// A surfel's colour from four f32: linear, straight alpha. Same interface as color_srgb8.wgsl.
// #import attributes::{attribute_vector, attribute_word}

fn surfel_alpha(index: u32) -> f32 {
    return bitcast<f32>(attribute_word(index, 3u));
}

fn premultiplied_color(index: u32) -> vec4<f32> {
    let color = attribute_vector(index, 0u);
    return vec4<f32>(color.rgb * color.a, color.a);
}
