// Every surfel is projected twice, for both sides of the border of a whole sphere. The first half
// of the slots has the splats at their places, the second half those that reach across the border.
// Same interface as cull_absent.wgsl.
// Twin: src/passes/project.rs.
// #import layout::{Splat, linear_index}
// #import records::{SplatRecord}
// #import select::{places_held, surfel_of}

fn slot_of(workgroup: vec3<u32>, workgroups: vec3<u32>, local: u32) -> u32 {
    return linear_index(workgroup, workgroups, local);
}

fn place_for(slot: u32) -> u32 {
    return select(slot, slot - places_held(), slot >= places_held());
}

fn anchor_words(splat: Splat, place: u32) -> vec2<u32> {
    return bitcast<vec2<u32>>(vec2<i32>(splat.anchor_x, splat.anchor_y));
}

fn anchor_of(words: vec2<u32>) -> vec2<i32> {
    return bitcast<vec2<i32>>(words);
}

fn surfel_in(record: SplatRecord, slot: u32) -> u32 {
    return surfel_of(place_for(slot));
}
