
fn write_surface(out: u32, number: u32, depth: f32, alpha: f32) {}

fn write_no_surfaces(out: u32, first: u32) {}
