// The image without maps: each pixel is one vector, its colour. Same interface as image_maps.wgsl.

@group(0) @binding(10) var<storage, read_write> image: array<vec4<f32>>;

fn write_color(out: u32, color: vec4<f32>) {
    image[out / 4u] = color;
}

// There is no map to write.
fn write_value(at: u32, value: f32) {}
