// A surfel's colour where its texture is not looked up: the texture's mean over its disk, as in color_linear.wgsl. The surfel's place
// in the texture follows it, in three more (texture.wgsl).

@group(0) @binding(11) var<storage, read> colors: array<vec4<f32>>;

fn color_of(index: u32) -> vec4<f32> {
    let color = colors[4u * index];
    return in_range(vec4<f32>(color.rgb * color.a, color.a));
}
