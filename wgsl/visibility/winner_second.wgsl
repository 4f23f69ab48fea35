// Without 64-bit atomics, a second pass over the fragments stores the colour of the fragment at the
// nearest depth; among several such fragments, the colour whose word is greatest. Both passes
// evaluate the same footprint, so the nearest fragment has exactly the stored depth.
// #import blend|winner::{Attributes}
// #import camera_orthographic|perspective::{Fragment}

// The colour of each pixel's nearest fragment; cleared before.
@group(0) @binding(43) var<storage, read_write> winners: array<atomic<u32>>;

fn blend(pixel: u32, fragment: Fragment, front: f32, attributes: Attributes) {
    atomicMax(&winners[pixel], attributes.word);
}

fn winning_word(pixel: u32) -> u32 {
    return atomicLoad(&winners[pixel]);
}
