// Fragments of a surface are blended by their kernel weights alone, and its alpha is their mean.
// Same interface as oit.wgsl.

fn weight_before(pixel: u32, depth: f32, weight: f32) -> f32 {
    return weight;
}

fn accumulate_held_back(pixel: u32, weight: f32, color: vec4<f32>) {}

fn with_held_back(color: vec4<f32>, sums_of: u32, weight: f32) -> vec4<f32> {
    return color;
}
