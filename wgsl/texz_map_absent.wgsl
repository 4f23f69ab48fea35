fn write_texz(out: u32, sums_of: u32, weight: f32, depth: f32) {}

fn write_no_texz(out: u32) {}
