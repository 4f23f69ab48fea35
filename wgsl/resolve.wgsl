// Stage 4: sums become the image: divide by the weight, shade, put over the background. Twin: src/passes/resolve.rs.

// Words of a pixel in the image (image_*.wgsl); the colour's four come first.
override IMAGE_WORDS: u32;

// Straight alpha over straight alpha.
fn over(front: vec4<f32>, back: vec4<f32>) -> vec4<f32> {
    let behind = back.a * (1.0 - front.a);
    let alpha = front.a + behind;
    return select(vec4<f32>(0.0), vec4<f32>((front.rgb * front.a + back.rgb * behind) / alpha, alpha), alpha > 0.0);
}

// The summed weight of a pixel, whose sums `sums_of` names: where nothing is, no sum need be read.
fn shown_weight(sums_of: u32, front: f32) -> f32 {
    var weight = 0.0;
    if (bitcast<u32>(front) != NOTHING) {
        weight = sum_at(sums_of, WEIGHT_CHANNEL);
    }
    return weight;
}

// The straight colour of the pixel (x, y), over the background.
fn shown_color(sums_of: u32, weight: f32, normal: vec3<f32>, x: u32, y: u32) -> vec4<f32> {
    let premultiplied = textured(sums_of, weight, resolve_color(sums_of, weight));
    let alpha = premultiplied.a;
    let color = select(vec3<f32>(0.0), premultiplied.rgb / alpha, alpha > 0.0);
    return over(vec4<f32>(shade_pixel(color, normal, x, y), alpha), held.background);
}
