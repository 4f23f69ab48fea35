// Visibility pass where only the nearest fragment of a pixel shows: stores depth and colour as one
// number, so this is the only pass over the fragments (Schuetz and Wimmer 2015 use the rasteriser's
// depth test). Needs 64-bit atomics. Same interface as nearest_depth.wgsl.
// #import accumulator_raster|visibility::{nearest}
// #import attributes::{attribute_word}
// #import camera_orthographic|perspective::{Fragment}
// #import layout::{kept_depth}

// The nearest fragment of each pixel: kept_depth() in the high word and colour in the low word. A
// cleared word means an empty pixel.
@group(0) @binding(43) var<storage, read_write> winners: array<atomic<u64>>;

// The word that a surfel's fragments store beside their depth: its colour.
fn mark_of(surfel: u32) -> u32 {
    return attribute_word(surfel, 0u);
}

// At equal depths the greatest mark wins, so the result does not depend on the order.
fn keep_nearest(pixel: u32, fragment: Fragment, mark: u32) {
    let kept = kept_depth(bitcast<u32>(fragment.depth));
    atomicMax(&winners[pixel], (u64(kept) << 32u) | u64(mark));
}

// Returns the bits of the nearest depth, and stores it where `visible` reads it from now on.
fn nearest_at(pixel: u32) -> u32 {
    let kept = u32(atomicLoad(&winners[pixel]) >> 32u);
    atomicStore(&nearest[pixel], kept);
    return kept_depth(kept);
}

fn winning_word(pixel: u32) -> u32 {
    return u32(atomicLoad(&winners[pixel]) & 0xfffffffflu);
}
