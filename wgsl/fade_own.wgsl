// The fades of surfels that are given (src/scene/fade.rs): those of a cut come with it (select_fades.wgsl).

// Which word of a surfel's attributes.
override FADE_WORD: u32;

fn fade_word(index: u32, place: u32) -> u32 {
    return attribute_word(index, FADE_WORD);
}
