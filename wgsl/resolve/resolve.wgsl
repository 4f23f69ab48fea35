// Stage 4: turns sums into the image: divides by the weight, shades, composites over the
// background.
// Twin: src/passes/resolve.rs.
// #import layout::{held}
// #import lit_*::{shade_pixel}

// Words of a pixel in the image (image_*.wgsl); the four of the colour come first.
override IMAGE_WORDS: u32;

// The factor on every alpha.
override OPACITY: f32;

// Composites straight alpha over straight alpha.
fn over(front: vec4<f32>, back: vec4<f32>) -> vec4<f32> {
    let behind = back.a * (1.0 - front.a);
    let alpha = front.a + behind;
    return select(vec4<f32>(0.0), vec4<f32>((front.rgb * front.a + back.rgb * behind) / alpha, alpha), alpha > 0.0);
}

// Shades a premultiplied colour at the pixel (x, y). Returns straight colour and alpha.
fn shaded(premultiplied: vec4<f32>, normal: vec3<f32>, x: u32, y: u32) -> vec4<f32> {
    let alpha = premultiplied.a;
    let color = select(vec3<f32>(0.0), premultiplied.rgb / alpha, alpha > 0.0);
    return vec4<f32>(shade_pixel(color, normal, x, y), alpha * OPACITY);
}

// Premultiplies a straight colour. The exclusive or with 0 keeps compilers from fusing the product
// with a later addition, so every kernel that draws a sample gets the same bits.
fn premultiplied_sample(straight: vec4<f32>) -> vec4<f32> {
    let product = vec4<f32>(straight.rgb * straight.a, straight.a);
    return bitcast<vec4<f32>>(bitcast<vec4<u32>>(product) ^ vec4<u32>(held.zero));
}
