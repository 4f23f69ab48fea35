
fn write_weight(out: u32, weight: f32) {}
