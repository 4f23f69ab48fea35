// Accepted fragments.

override COUNT_CHANNEL: u32;
override COUNT_IMAGE: u32;

fn accumulate_count(pixel: u32) {
    add(pixel, COUNT_CHANNEL, COUNT_ONE);
}

fn write_count(out: u32, pixel: u32) {
    image[out + COUNT_IMAGE] = sum_at(pixel, COUNT_CHANNEL);
}
