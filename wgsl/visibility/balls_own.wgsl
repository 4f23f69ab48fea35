// The bounding balls of the batches of a scene, which the host computes when it stores them.
// Same interface as balls_cut.wgsl.

// Centre and radius, world units relative to the scene's origin.
@group(0) @binding(23) var<storage, read> balls: array<vec4<f32>>;

fn batches_held() -> u32 {
    return arrayLength(&balls);
}

fn sphere_of(batch: u32) -> vec4<f32> {
    return balls[batch];
}
