// Accepted fragments.

override COUNT_CHANNEL: u32;
override COUNT_IMAGE: u32;

fn accumulate_count(pixel: u32, weight: Term) {
    add(pixel, COUNT_CHANNEL, select(Term(0), COUNT_ONE, weight != Term(0)));
}

// Where a triangle shows.
fn write_one(out: u32) {
    image[out + COUNT_IMAGE] = 1.0;
}

fn write_count(out: u32, pixel: u32) {
    image[out + COUNT_IMAGE] = sum_at(pixel, COUNT_CHANNEL);
}
