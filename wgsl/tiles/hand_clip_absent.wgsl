// #import clip::{Clip}

fn handed_clip(own: Clip, from_: u32) -> Clip {
    return own;
}
