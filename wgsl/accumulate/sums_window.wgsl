// The sums of a workgroup's pixels in workgroup memory. Its fragments overlap, and here their terms
// meet before they go to storage. The memory is a hash table with places for WINDOW blocks of 2x2
// pixels. Fragments in blocks that find no places go to storage one by one.
// Same interface as sums_direct.wgsl.
// Kernels set the workgroup memory of this file before they read it.
// All loops end, by 1 of src/gpu/loops.rs: 0xe246c60b3d4ba92a
// #import *::{CHANNELS, Term}
// #import accumulator_*::{add_pair_stored, add_stored, deposit_stored, settle_stored}
// #import footprint::{pixel_index}
// #import layout::{WEIGHT_CHANNEL}
// #import terms|terms_wide::{term_words}

// The number of blocks that have places, and the sides of a block, pixels.
override WINDOW: u32;
const WINDOW_BLOCK: u32 = 2u;
const BLOCK_PIXELS: u32 = WINDOW_BLOCK * WINDOW_BLOCK;

// For each channel a word for each place, which holds the sum without its carries. Then for each
// four channels a word for each place, whose bytes count the carries. A workgroup draws 256 splats,
// each at most once in a pixel, and 256 words carry at most 255 times, so no byte overflows.
// Neighbouring pixels have neighbouring words, which lie in different banks of memory.
const WINDOW_WORDS: u32 = 5760u;
var<workgroup> window: array<atomic<u32>, WINDOW_WORDS>;
// The blocks of the image that have places: column and row as lower and upper 16 bits, plus 1; 0 if
// there is none.
const MOST_BLOCKS: u32 = 288u;
var<workgroup> window_owners: array<atomic<u32>, MOST_BLOCKS>;

// The place in the window of the pixel that a fragment adds to, or OUTSIDE for sums in storage.
const OUTSIDE: u32 = 0xffffffffu;
var<private> window_place: u32 = OUTSIDE;

// The sides of the square of blocks that all have different first choices of places.
override WINDOW_SIDE: u32;
// The number of choices that a block has.
const CHOICES: u32 = 4u;

fn choice_of(block: vec2<u32>, choice: u32) -> u32 {
    return (block.y % WINDOW_SIDE * WINDOW_SIDE + block.x % WINDOW_SIDE + choice) % WINDOW;
}

fn owner_of(block: vec2<u32>) -> u32 {
    return (block.x | (block.y << 16u)) + 1u;
}

// Takes places for a block of the image. An exchange that fails without a reason may give a block
// places twice, or none.
fn claim_block(block: vec2<u32>) {
    let own = owner_of(block);
    var owned = false;
    for (var k = 0u; k < CHOICES && !owned; k++) {
        let found = atomicCompareExchangeWeak(&window_owners[choice_of(block, k)], 0u, own);
        owned = found.exchanged || found.old_value == own;
    }
}

// The place of a pixel, or OUTSIDE if its block has none.
fn place_in_window(at: vec2<u32>) -> u32 {
    let block = at / WINDOW_BLOCK;
    let own = owner_of(block);
    let within = at % WINDOW_BLOCK;
    var place = OUTSIDE;
    for (var k = 0u; k < CHOICES && place == OUTSIDE; k++) {
        let choice = choice_of(block, k);
        if (atomicLoad(&window_owners[choice]) == own) {
            place = choice * BLOCK_PIXELS + within.y * WINDOW_BLOCK + within.x;
        }
    }
    return place;
}

// The pixel of a place whose block has an owner.
fn pixel_in_window(place: u32) -> vec2<u32> {
    let owner = atomicLoad(&window_owners[place / BLOCK_PIXELS]) - 1u;
    let within = vec2<u32>(place % WINDOW_BLOCK, place % BLOCK_PIXELS / WINDOW_BLOCK);
    return vec2<u32>(owner & 0xffffu, owner >> 16u) * WINDOW_BLOCK + within;
}

fn sum_word(place: u32, channel: u32) -> u32 {
    return channel * WINDOW * BLOCK_PIXELS + place;
}

// The word with the carries of a sum, which has those of three more.
fn carries_word(place: u32, channel: u32) -> u32 {
    return (CHANNELS + channel / 4u) * WINDOW * BLOCK_PIXELS + place;
}

// The terms of the current fragment; a compiler drops those that are not used.
const MOST_TERMS: u32 = 18u;
var<private> fragment_terms: array<u32, MOST_TERMS>;

fn add(pixel: u32, channel: u32, value: Term) {
    fragment_terms[channel] = term_words(value).x;
}

fn add_pair(pixel: u32, channel: u32, first: Term, second: Term) {
    add(pixel, channel, first);
    add(pixel, channel + 1u, second);
}

// Adds the terms of a fragment.
fn settle(pixel: u32) {
    if (window_place == OUTSIDE) {
        for (var channel = 0u; channel < CHANNELS; channel += 2u) {
            // The last channel may be unused.
            if (fragment_terms[channel + 1u] == 0u) {
                add_stored(pixel, channel, fragment_terms[channel]);
            } else {
                add_pair_stored(pixel, channel, fragment_terms[channel], fragment_terms[channel + 1u]);
            }
        }
        settle_stored(pixel);
        return;
    }
    for (var channel = 0u; channel < CHANNELS; channel++) {
        let term = fragment_terms[channel];
        let before = atomicAdd(&window[sum_word(window_place, channel)], term);
        if (before + term < before) {
            atomicAdd(&window[carries_word(window_place, channel)], 1u << (8u * (channel % 4u)));
        }
    }
}

// Returns a sum of the window: low and high word.
fn window_sum(place: u32, channel: u32) -> vec2<u32> {
    let carries = atomicLoad(&window[carries_word(place, channel)]);
    let high = (carries >> (8u * (channel % 4u))) & 0xffu;
    return vec2<u32>(atomicLoad(&window[sum_word(place, channel)]), high);
}

// Adds the sums at a place of the window to those in storage, if the place has a fragment: then its
// weight is not 0.
fn flush(place: u32) {
    if (all(window_sum(place, WEIGHT_CHANNEL) == vec2<u32>(0u))) {
        return;
    }
    let at = pixel_in_window(place);
    let pixel = pixel_index(at.x, at.y);
    for (var channel = 0u; channel < CHANNELS; channel += 2u) {
        deposit_stored(pixel, channel, window_sum(place, channel), window_sum(place, channel + 1u));
    }
}
