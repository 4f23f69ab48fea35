// A surfel's colour from four f32: linear, straight alpha.

fn premultiplied_color(index: u32) -> vec4<f32> {
    let color = attribute_vector(index, 0u);
    return vec4<f32>(color.rgb * color.a, color.a);
}
