// A surfel's colour from four bytes of sRGB and straight alpha.

fn premultiplied_color(index: u32) -> vec4<f32> {
    return premultiplied_of(attribute_word(index, 0u));
}
