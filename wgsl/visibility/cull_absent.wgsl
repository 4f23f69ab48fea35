// Every surfel is projected, and the slot of its splat is its place in the page. Same interface as
// cull.wgsl.
// #import layout::{Splat, linear_index}
// #import records::{SplatRecord}
// #import select::{surfel_of}

fn slot_of(workgroup: vec3<u32>, workgroups: vec3<u32>, local: u32) -> u32 {
    return linear_index(workgroup, workgroups, local);
}

fn place_for(slot: u32) -> u32 {
    return slot;
}

fn anchor_words(splat: Splat, place: u32) -> vec2<u32> {
    return bitcast<vec2<u32>>(vec2<i32>(splat.anchor_x, splat.anchor_y));
}

fn anchor_of(words: vec2<u32>) -> vec2<i32> {
    return bitcast<vec2<i32>>(words);
}

fn surfel_in(record: SplatRecord, slot: u32) -> u32 {
    return surfel_of(slot);
}
