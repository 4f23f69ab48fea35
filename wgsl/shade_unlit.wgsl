fn shade(color: vec3<f32>, normal: vec3<f32>, x: u32, y: u32) -> vec3<f32> {
    return color;
}
