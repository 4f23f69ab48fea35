// A surfel's colour from four bytes of sRGB and straight alpha.

fn color_of(index: u32) -> vec4<f32> {
    return in_range(premultiplied_of(attribute_word(index, 0u)));
}
