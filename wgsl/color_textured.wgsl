// A surfel's colour where its texture is not looked up: the texture's mean over its disk, as in color_linear.wgsl. The surfel's place
// in the texture follows it, in three more (texture.wgsl), each of which has three numbers and a coordinate of what the surfel's centre leaves out.

fn color_part(index: u32, part: u32) -> vec4<f32> {
    return attribute_vector(index, 4u * part);
}

fn surfel_alpha(index: u32) -> f32 {
    return color_part(index, 0u).a;
}

fn premultiplied_color(index: u32) -> vec4<f32> {
    let color = color_part(index, 0u);
    return vec4<f32>(color.rgb * color.a, color.a);
}
