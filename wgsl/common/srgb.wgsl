// Decodes 8-bit sRGB with a table from the host (src/scene/color.rs).

@group(0) @binding(12) var<uniform> srgb_to_linear: array<vec4<f32>, 64>;

fn linear_of(code: u32) -> f32 {
    return srgb_to_linear[code / 4u][code % 4u];
}

// Decodes four bytes of sRGB and straight alpha to linear RGB premultiplied by alpha, and alpha.
fn premultiplied_of(code: u32) -> vec4<f32> {
    let alpha = f32(code >> 24u) / 255.0;
    let linear = vec3<f32>(
        linear_of(code & 0xffu),
        linear_of((code >> 8u) & 0xffu),
        linear_of((code >> 16u) & 0xffu),
    );
    return vec4<f32>(linear * alpha, alpha);
}
