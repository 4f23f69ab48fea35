// color * sum of intensity * max(0, n . toward) over the lights. Twin: src/passes/resolve.rs.
fn shade(color: vec3<f32>, normal: vec3<f32>, x: u32, y: u32) -> vec3<f32> {
    let toward_eye = -ray(x, y);
    var irradiance = 0.0;
    for (var i = 0u; i < view.light_count; i++) {
        let light = view.lights[i];
        let headlight = all(light.xyz == vec3<f32>(0.0));
        irradiance += light.w * max(0.0, dot(normal, select(light.xyz, toward_eye, headlight)));
    }
    return color * irradiance;
}
