fn accumulate_depth(word: u32, weight: u32, depth: f32, front: f32, back: f32) {}

fn write_depth(out: u32, word: u32, weight: f32, front: f32) {}

fn write_no_depth(out: u32, front: f32) {}
