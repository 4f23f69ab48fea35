// No low-pass: a pixel's centre is in the disk or not. Same interface as filter.wgsl with
// lowpass_max.wgsl or lowpass_ewa.wgsl.
// #import camera_orthographic|perspective::{Fragment}
// #import records::{SplatRecord}
// #import rows::{Homography}

const FILTERED: bool = false;

struct Filter {
    nothing: u32,
}

const FILTER_ROWS: u32 = 0u;

fn with_filter(record: SplatRecord, filter_: Filter) -> SplatRecord {
    return record;
}

fn filter_in(record: SplatRecord) -> Filter {
    return Filter(0u);
}

fn low_pass(h: ptr<function, Homography>) -> Filter {
    return Filter(0u);
}

fn least_filtered(filter_: Filter) -> f32 {
    return 3e38;
}

fn filtered(fragment: Fragment, abc: vec3<f32>, filter_: Filter, d: vec2<f32>) -> Fragment {
    return fragment;
}
