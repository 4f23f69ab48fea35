fn accumulate_count(pixel: u32, weight: Term) {}

fn write_count(out: u32, pixel: u32) {}
