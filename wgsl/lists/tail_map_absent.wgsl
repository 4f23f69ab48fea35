
fn write_tail(out: u32, weight: f32) {}
