// color * sum of intensity * cosine over the lights. The headlight lights both sides of a surface,
// with |n . toward_eye|; a directional light lights the side of the normal.
// Twin: src/passes/resolve.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x12ab3e35b8fc6bc0
// #import layout::{held}
// #import vectors::{dot3}

// A constant, because some drivers (Mesa's lavapipe) recompile a kernel for every frame if a
// uniform ends one of its loops.
override LIGHTS: u32;

fn shade(color: vec3<f32>, normal: vec3<f32>, toward_eye: vec3<f32>) -> vec3<f32> {
    var irradiance = 0.0;
    for (var i = 0u; i < LIGHTS; i++) {
        let light = held.lights[i];
        if (all(light.xyz == vec3<f32>(0.0))) {
            irradiance += light.w * abs(dot3(normal, toward_eye));
        } else {
            irradiance += light.w * max(0.0, dot3(normal, light.xyz));
        }
    }
    return color * irradiance;
}
