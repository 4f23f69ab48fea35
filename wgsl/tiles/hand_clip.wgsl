// Clipped disks in columns: the clip lines of a splat that another invocation fetched (tile.wgsl).
// #import clip::{Clip}
// #import tile::{handed_vector}

fn handed_clip(own: Clip, from_: u32) -> Clip {
    let turn = handed_vector(vec3<f32>(own.turn, 0.0), from_).xy;
    return Clip(handed_vector(own.first, from_), handed_vector(own.second, from_), turn);
}
