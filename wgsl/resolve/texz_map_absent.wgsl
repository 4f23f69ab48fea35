
fn place_of_sums(sums_of: u32, weight: f32) -> vec2<f32> {
    return vec2<f32>(0.0);
}

fn write_texz(out: u32, place: vec2<f32>, depth: f32) {}

fn write_no_texz(out: u32) {}
