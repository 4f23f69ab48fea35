fn accumulate_count(word: u32) {}

fn write_count(out: u32, word: u32) {}
