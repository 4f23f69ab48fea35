// The number of accepted fragments of each pixel. Same interface as count_absent.wgsl.
// #import *::{COUNT_ONE, Term, add, sum_at}
// #import image_*::{image}

override COUNT_CHANNEL: u32;
override COUNT_IMAGE: u32;

fn accumulate_count(pixel: u32, weight: Term) {
    add(pixel, COUNT_CHANNEL, select(Term(0), COUNT_ONE, weight != Term(0)));
}

fn count_of(pixel: u32) -> f32 {
    return sum_at(pixel, COUNT_CHANNEL);
}

fn write_count(out: u32, count: f32) {
    image[out + COUNT_IMAGE] = count;
}
