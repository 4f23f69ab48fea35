// color * sum of intensity * cosine over the lights. The headlight lights both sides of a surface, n . toward_eye in
// absolute value; a directional light the side its normal is on. Twin: src/passes/resolve.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x12ab3e35b8fc6bc0

// A constant, as some drivers compile a kernel whose loops end by a uniform again for every frame (Mesa's lavapipe).
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
