
fn write_normal(out: u32, normal: vec3<f32>) {}
