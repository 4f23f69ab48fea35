// A surfel's colour from four bytes of sRGB and straight alpha.

fn surfel_alpha(index: u32) -> f32 {
    return f32(attribute_word(index, 0u) >> 24u) / 255.0;
}

fn premultiplied_color(index: u32) -> vec4<f32> {
    return premultiplied_of(attribute_word(index, 0u));
}
