// Fades that are given with the surfels (src/scene/fade.rs). Those of a cut come from
// select_fades.wgsl.
// #import attributes::{attribute_word}

// The word of a surfel's attributes that holds its fade.
override FADE_WORD: u32;

fn fade_word(index: u32, place: u32) -> u32 {
    return attribute_word(index, FADE_WORD);
}
