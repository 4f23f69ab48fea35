// The colours of splats and triangles are linear light. Same interface as join_coded.wgsl.

fn color_beside(color: vec4<f32>) -> vec4<f32> {
    return color;
}
