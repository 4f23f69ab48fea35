fn normal_of(index: u32, splat: Splat) -> vec3<f32> {
    return vec3<f32>(0.0);
}

fn accumulate_normal(word: u32, weight: u32, normal: vec3<f32>) {}

fn resolve_normal(word: u32, weight: f32) -> vec3<f32> {
    return vec3<f32>(0.0);
}
