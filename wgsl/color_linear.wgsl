// A surfel's colour from four f32: linear, straight alpha.

fn color_of(index: u32) -> vec4<f32> {
    let color = attribute_vector(index, 0u);
    return in_range(vec4<f32>(color.rgb * color.a, color.a));
}
