
fn write_transmittance(out: u32, transmittance: f32) {}
