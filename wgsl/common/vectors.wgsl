// Products of vectors whose terms are added in the order that is written here. WGSL leaves the
// order of the built-in dot, cross, length and normalize to the driver, and so their rounding.
// NVIDIA's driver chooses the order by the surrounding code (src/gpu/spirv.rs). A test checks that
// kernels use none of these built-ins.

fn dot2(a: vec2<f32>, b: vec2<f32>) -> f32 {
    return a.x * b.x + a.y * b.y;
}

fn dot3(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

fn cross3(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return a.yzx * b.zxy - a.zxy * b.yzx;
}

fn norm2(a: vec2<f32>) -> f32 {
    return sqrt(dot2(a, a));
}

fn norm3(a: vec3<f32>) -> f32 {
    return sqrt(dot3(a, a));
}

fn unit2(a: vec2<f32>) -> vec2<f32> {
    return a / norm2(a);
}

fn unit3(a: vec3<f32>) -> vec3<f32> {
    return a / norm3(a);
}

// Interpolates linearly; exact for a share of 0 and of 1.
fn between(a: vec4<f32>, b: vec4<f32>, share: f32) -> vec4<f32> {
    return a * (1.0 - share) + b * share;
}
