// color * sum of intensity * cosine over the lights. The headlight lights both sides of a surface,
// with |n . toward_eye|; a directional light lights the side of the normal.
// Twin: src/passes/resolve.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xef234b222b8e6342
// #import layout::{held}
// #import vectors::{dot3}

// A constant, because some drivers (Mesa's lavapipe) recompile a kernel for every frame, and keep
// all versions, if uniforms alone decide a loop or a branch. So the loop selects and does not
// branch either.
override LIGHTS: u32;

fn shade(color: vec3<f32>, normal: vec3<f32>, toward_eye: vec3<f32>) -> vec3<f32> {
    var irradiance = 0.0;
    for (var i = 0u; i < LIGHTS; i++) {
        let light = held.lights[i];
        let is_headlight = all(light.xyz == vec3<f32>(0.0));
        let facing = dot3(normal, select(light.xyz, toward_eye, is_headlight));
        irradiance += light.w * select(max(0.0, facing), abs(facing), is_headlight);
    }
    return color * irradiance;
}
