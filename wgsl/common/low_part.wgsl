// The part of the centre of a surfel or tree node beyond f32, world units. It is stored with its
// attributes (center_doubled.wgsl), which lie in `chosen` in front of the list of chosen surfels: a
// buffer that a kernel writes cannot be bound twice.
// #import attributes::{ATTRIBUTE_WORDS}
// #import center_doubled::{LOW_WORD}
// #import select::{chosen}

fn low_part(index: u32) -> vec3<f32> {
    let at = index * ATTRIBUTE_WORDS + LOW_WORD;
    return bitcast<vec3<f32>>(vec3<u32>(chosen[at], chosen[at + 1u], chosen[at + 2u]));
}
