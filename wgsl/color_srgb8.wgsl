// A surfel's colour from four bytes of sRGB and straight alpha.

@group(0) @binding(11) var<storage, read> colors: array<u32>;

fn color_of(index: u32) -> vec4<f32> {
    return in_range(premultiplied_of(colors[index]));
}
