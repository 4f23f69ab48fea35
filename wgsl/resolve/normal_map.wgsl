// All loops end, by 1 of src/gpu/loops.rs: 0xe732c943c0d94d0f
// #import image_*::{image}

override NORMAL_IMAGE: u32;

fn write_normal(out: u32, normal: vec3<f32>) {
    for (var k = 0u; k < 3u; k++) {
        image[out + NORMAL_IMAGE + k] = normal[k];
    }
}
