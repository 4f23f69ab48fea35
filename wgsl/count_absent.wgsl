fn accumulate_count(pixel: u32, weight: Term) {}

fn write_one(out: u32) {}

fn write_count(out: u32, pixel: u32) {}
