// A surfel's colour where its texture is not looked up: the texture's mean over its disk, in four
// f32 as in color_linear.wgsl. Three more vectors follow (texture.wgsl). Each has three numbers for
// the texture coordinates and one coordinate of the low part of the surfel's centre.
// #import attributes::{attribute_vector}

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
