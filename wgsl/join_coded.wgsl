// Colours of splats are codes of sRGB, as those of Gaussians are, and become linear light when all
// is drawn: so do those of triangles here, which are made codes first. Same interface as
// join_linear.wgsl. Twin: src/passes/join.rs.

fn color_beside(color: vec4<f32>) -> vec4<f32> {
    let linear = clamp(color.rgb, vec3<f32>(0.0), vec3<f32>(1.0));
    let curve = 1.055 * pow(max(linear, vec3<f32>(0.0031308)), vec3<f32>(1.0 / 2.4)) - 0.055;
    return vec4<f32>(select(curve, 12.92 * linear, linear <= vec3<f32>(0.0031308)), color.a);
}
