fn accumulate_depth(pixel: u32, weight: Term, depth: f32, front: f32) {}

fn surface_depth(pixel: u32, weight: f32, front: f32) -> f32 {
    return front;
}

fn write_depth(out: u32, pixel: u32, weight: f32, front: f32) {}

fn write_no_depth(out: u32) {}
