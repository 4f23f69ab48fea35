override NORMAL_IMAGE: u32;

fn write_normal(out: u32, normal: vec3<f32>) {
    for (var k = 0u; k < 3u; k++) {
        image[out + NORMAL_IMAGE + k] = normal[k];
    }
}
