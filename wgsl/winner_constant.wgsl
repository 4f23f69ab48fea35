// All surfels have one colour, so that the nearest depth is all there is to know.

fn resolve_color(pixel: u32, weight: f32) -> vec4<f32> {
    return held.color_low;
}
