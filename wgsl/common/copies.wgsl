// Equal surfels are drawn once, as one surfel that stores their number. Same interface as
// copies_absent.wgsl.
// Host side and twin: src/scene/copies.rs.
// #import attributes::{attribute_word}

// The word of a surfel's attributes that holds the number of its copies, itself included.
override COPIES_WORD: u32;

// The number of copies of the current splat's surfel.
var<private> times: u32;

fn copies_of(index: u32) -> u32 {
    return attribute_word(index, COPIES_WORD);
}

fn hold_copies(index: u32) {
    times = copies_of(index);
}

// a * b as low and high word, computed from half words.
fn product_words(a: u32, b: u32) -> vec2<u32> {
    let a_low = a & 0xffffu;
    let a_high = a >> 16u;
    let b_low = b & 0xffffu;
    let b_high = b >> 16u;
    // Each of the next three values is at most (2^16 - 1)^2 + 2^16 - 1, which fits a word.
    let lowest = a_low * b_low;
    let one = a_high * b_low + (lowest >> 16u);
    let other = a_low * b_high + (one & 0xffffu);
    return vec2<u32>((other << 16u) | (lowest & 0xffffu), a_high * b_high + (one >> 16u) + (other >> 16u));
}

// A term (low, high word) times the number of copies of the current splat's surfel.
fn multiplied(term: vec2<u32>) -> vec2<u32> {
    let low = product_words(term.x, times);
    return vec2<u32>(low.x, low.y + term.y * times);
}
