// A surfel's colour from four bytes of sRGB and straight alpha. The table is the host's (src/scene/color.rs).

@group(0) @binding(11) var<storage, read> colors: array<u32>;
@group(0) @binding(12) var<uniform> srgb_to_linear: array<vec4<f32>, 64>;

fn linear_of(code: u32) -> f32 {
    return srgb_to_linear[code / 4u][code % 4u];
}

fn color_of(index: u32) -> vec4<f32> {
    let code = colors[index];
    let alpha = f32(code >> 24u) / 255.0;
    let linear = vec3<f32>(
        linear_of(code & 0xffu),
        linear_of((code >> 8u) & 0xffu),
        linear_of((code >> 16u) & 0xffu),
    );
    return in_range(vec4<f32>(linear * alpha, alpha));
}
