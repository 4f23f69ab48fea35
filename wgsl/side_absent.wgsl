fn accumulate_side(pixel: u32, weight: Term, turned: f32) {}

fn side_at(pixel: u32, weight: f32) -> f32 {
    return 1.0;
}
