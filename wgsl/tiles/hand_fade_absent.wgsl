// #import fade::{Fade}

fn handed_fade(own: Fade, from_: u32) -> Fade {
    return own;
}
