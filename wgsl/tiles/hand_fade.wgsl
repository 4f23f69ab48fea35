// The fade of a splat that another invocation fetched (tile.wgsl).
// #import fade::{Fade}
// #import splat_*::{handed}

fn handed_fade(own: Fade, from_: u32) -> Fade {
    return Fade(handed(own.first, from_), handed(own.end, from_));
}
