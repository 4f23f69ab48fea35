// A surfel's colour from four bytes: sRGB, straight alpha. Same interface as color_linear.wgsl.
// #import attributes::{attribute_word}
// #import srgb::{premultiplied_of}

fn surfel_alpha(index: u32) -> f32 {
    return f32(attribute_word(index, 0u) >> 24u) / 255.0;
}

fn premultiplied_color(index: u32) -> vec4<f32> {
    return premultiplied_of(attribute_word(index, 0u));
}
