// A surfel stands for all that are the same: how many they are. Same interface as copies_absent.wgsl. Host side and twin:
// src/scene/copies.rs.

@group(0) @binding(40) var<storage, read> copies: array<u32>;

// Those of the splat in work.
var<private> times: u32;

fn copies_of(index: u32) -> u32 {
    return copies[index];
}

fn hold_copies(index: u32) {
    times = copies[index];
}
