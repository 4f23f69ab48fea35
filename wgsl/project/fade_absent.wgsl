// Every splat is in all cuts. Same interface as fade.wgsl.
// #import camera_orthographic|perspective::{Fragment}
// #import records::{SplatRecord}

struct Fade {
    nothing: u32,
}

fn fade_of(index: u32, place: u32) -> Fade {
    return Fade(0u);
}

const FADE_ROWS: u32 = 0u;

fn with_fade(record: SplatRecord, fade: Fade) -> SplatRecord {
    return record;
}

fn fade_in(record: SplatRecord) -> Fade {
    return Fade(0u);
}

fn faded(fragment: Fragment, fade: Fade) -> Fragment {
    return fragment;
}

fn takes_sample(fade: Fade, x: u32, y: u32) -> bool {
    return true;
}

fn meets_front(depth: f32, front: f32, radius: f32, image: vec2<f32>) -> bool {
    return true;
}
