// The image with maps, which follow the colour of each pixel. Same interface as image_color.wgsl.
// All loops end, by 1 of src/gpu/loops.rs: 0x99cbc522705856b6

@group(0) @binding(10) var<storage, read_write> image: array<f32>;

fn write_color(out: u32, color: vec4<f32>) {
    for (var k = 0u; k < 4u; k++) {
        image[out + k] = color[k];
    }
}

fn write_value(at: u32, value: f32) {
    image[at] = value;
}
