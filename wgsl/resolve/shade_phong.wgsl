// Lambert's term as in shade_lambert.wgsl, plus white highlights where the eye is near a light's
// mirrored direction r = 2 (n . l) n - l: sum of intensity * (n . l) * max(0, r . v)^SHININESS.
// Twin: src/passes/resolve.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0xd91a88a63674e85e
// #import layout::{held}
// #import vectors::{dot3}

override SHININESS: f32;
// A constant for the reason in shade_lambert.wgsl.
override LIGHTS: u32;

// HIGHLIGHT in src/scene/options.rs.
const HIGHLIGHT: f32 = 0.3;

fn shade(color: vec3<f32>, normal: vec3<f32>, toward_eye: vec3<f32>) -> vec3<f32> {
    let facing_eye = dot3(normal, toward_eye);
    var irradiance = 0.0;
    var highlight = 0.0;
    for (var i = 0u; i < LIGHTS; i++) {
        let light = held.lights[i];
        let is_headlight = all(light.xyz == vec3<f32>(0.0));
        let toward = select(light.xyz, toward_eye, is_headlight);
        let facing = dot3(normal, toward);
        let received = light.w * select(max(0.0, facing), abs(facing), is_headlight);
        let mirrored = 2.0 * facing * facing_eye - dot3(toward, toward_eye);
        irradiance += received;
        highlight += received * pow(max(0.0, mirrored), SHININESS);
    }
    return color * irradiance + HIGHLIGHT * highlight;
}
