// Colours of splats are sRGB codes, as in files of Gaussians, and become linear light once all is
// drawn. Colours of triangles are therefore converted to codes before they are joined. Same
// interface as join_linear.wgsl. Twin: src/passes/join.rs.

fn color_beside(color: vec4<f32>) -> vec4<f32> {
    let linear = clamp(color.rgb, vec3<f32>(0.0), vec3<f32>(1.0));
    let curve = 1.055 * pow(max(linear, vec3<f32>(0.0031308)), vec3<f32>(1.0 / 2.4)) - 0.055;
    return vec4<f32>(select(curve, 12.92 * linear, linear <= vec3<f32>(0.0031308)), color.a);
}
