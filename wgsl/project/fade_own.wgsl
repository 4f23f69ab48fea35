// Fades that are stored with the surfels (src/scene/fade.rs). For cuts chosen on the device,
// select_fades.wgsl replaces this file.
// #import attributes::{attribute_word}

// The word of a surfel's attributes that holds its fade.
override FADE_WORD: u32;

fn fade_word(index: u32, place: u32) -> u32 {
    return attribute_word(index, FADE_WORD);
}
