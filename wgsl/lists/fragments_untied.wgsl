// Fragments of the same depth may come in any order, because no result depends on it. Same
// interface as fragments_ranked.wgsl.
// #import camera_orthographic|perspective::{Fragment}
// #import fragments::{Record}

const TIES: bool = false;

fn is_listed(pixel: u32, fragment: Fragment, alpha: f32) -> bool {
    return true;
}

fn with_rank(record: Record, surfel: u32) -> Record {
    return record;
}

fn precedes(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.x < b.x;
}
