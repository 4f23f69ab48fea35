// Fragments are not counted. Same interface as count.wgsl.
// #import *::{Term}

fn accumulate_count(pixel: u32, weight: Term) {}

fn count_of(pixel: u32) -> f32 {
    return 0.0;
}

fn write_count(out: u32, count: f32) {}
