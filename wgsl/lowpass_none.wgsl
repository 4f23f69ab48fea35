// No low-pass: a pixel's centre is in the disk or not. Same interface as filter.wgsl with lowpass_*.wgsl.

const FILTERED: bool = false;

struct Filter {
    nothing: u32,
}

fn filter_of(slot: u32) -> Filter {
    return Filter(0u);
}

fn low_pass(slot: u32, h: ptr<function, Homography>) {}

fn least_filtered(filter_: Filter) -> f32 {
    return 3e38;
}

fn filtered(fragment: Fragment, abc: vec3<f32>, filter_: Filter, d: vec2<f32>) -> Fragment {
    return fragment;
}
