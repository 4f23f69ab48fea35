// A surfel's colour from four bytes of sRGB and straight alpha. The table is the host's (src/scene/color.rs).

@group(0) @binding(11) var<storage, read> colors: array<u32>;
@group(0) @binding(12) var<storage, read> srgb_to_linear: array<f32>;

fn color_of(index: u32) -> vec4<f32> {
    let code = colors[index];
    let alpha = f32(code >> 24u) / 255.0;
    let linear = vec3<f32>(
        srgb_to_linear[code & 0xffu],
        srgb_to_linear[(code >> 8u) & 0xffu],
        srgb_to_linear[(code >> 16u) & 0xffu],
    );
    return in_range(vec4<f32>(linear * alpha, alpha));
}
