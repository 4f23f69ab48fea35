// A surfel stands for all that are the same: how many they are. Same interface as copies_absent.wgsl. Host side and twin:
// src/scene/copies.rs.

// Which word of a surfel's attributes.
override COPIES_WORD: u32;

// Those of the splat in work.
var<private> times: u32;

fn copies_of(index: u32) -> u32 {
    return attribute_word(index, COPIES_WORD);
}

fn hold_copies(index: u32) {
    times = copies_of(index);
}

// a * b, low and high word, by halves of words.
fn product_words(a: u32, b: u32) -> vec2<u32> {
    let a_low = a & 0xffffu;
    let a_high = a >> 16u;
    let b_low = b & 0xffffu;
    let b_high = b >> 16u;
    // Each is at most (2^16 - 1)^2 + 2^16 - 1, which a word holds.
    let lowest = a_low * b_low;
    let one = a_high * b_low + (lowest >> 16u);
    let other = a_low * b_high + (one & 0xffffu);
    return vec2<u32>((other << 16u) | (lowest & 0xffffu), a_high * b_high + (one >> 16u) + (other >> 16u));
}

// A term (low, high word) as often as the splat in work stands for a surfel.
fn multiplied(term: vec2<u32>) -> vec2<u32> {
    let low = product_words(term.x, times);
    return vec2<u32>(low.x, low.y + term.y * times);
}
