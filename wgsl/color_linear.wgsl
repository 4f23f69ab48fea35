// A surfel's colour from four f32: linear, straight alpha.

@group(0) @binding(11) var<storage, read> colors: array<Words>;

fn color_of(index: u32) -> vec4<f32> {
    let color = bitcast<vec4<f32>>(each_word(colors[index]));
    return in_range(vec4<f32>(color.rgb * color.a, color.a));
}
