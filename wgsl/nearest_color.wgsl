// What the visibility pass keeps of the fragments of a pixel where the nearest alone shows: its depth and its colour in one number, so
// that it is the only pass over them (Schuetz and Wimmer 2015 leave this to the rasteriser's depth test). Needs 64-bit atomics.

// Cleared: nothing anywhere.
@group(0) @binding(43) var<storage, read_write> winners: array<atomic<u64>>;

// What a surfel leaves beside its depth.
fn mark_of(surfel: u32) -> u32 {
    return attribute_word(surfel, 0u);
}

// Of one depth the greatest mark wins, whatever the order.
fn keep_nearest(pixel: u32, fragment: Fragment, mark: u32) {
    let kept = kept_depth(bitcast<u32>(fragment.depth));
    atomicMax(&winners[pixel], (u64(kept) << 32u) | u64(mark));
}

// The bits of the nearest depth, where `visible` has it from now on.
fn nearest_at(pixel: u32) -> u32 {
    let kept = u32(atomicLoad(&winners[pixel]) >> 32u);
    atomicStore(&nearest[pixel], kept);
    return kept_depth(kept);
}

fn winning_word(pixel: u32) -> u32 {
    return u32(atomicLoad(&winners[pixel]) & 0xfffffffflu);
}
