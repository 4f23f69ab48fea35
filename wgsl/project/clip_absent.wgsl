// Disks end at their rims only. Same interface as clip.wgsl.
// #import camera_orthographic|perspective::{Fragment}
// #import records::{SplatRecord}

struct Clip {
    nothing: u32,
}

fn clip_of(index: u32, turn: vec2<f32>) -> Clip {
    return Clip(0u);
}

const CLIP_ROWS: u32 = 0u;

fn with_clip(record: SplatRecord, clip: Clip) -> SplatRecord {
    return record;
}

fn clip_in(record: SplatRecord) -> Clip {
    return Clip(0u);
}

fn cuts(clip: Clip, p: vec3<f32>) -> bool {
    return false;
}

fn clipped(fragment: Fragment, clip: Clip, abc: vec3<f32>) -> Fragment {
    return fragment;
}
