// The part of the centre of a surfel or tree node that f32 leaves out, world units. The attributes
// store it (center_doubled.wgsl). They are read through the binding `chosen`, where the list of
// chosen surfels follows them, because a buffer that a kernel writes cannot be bound twice.
// #import attributes::{ATTRIBUTE_WORDS}
// #import center_doubled::{LOW_WORD}
// #import select::{chosen}

fn low_part(index: u32) -> vec3<f32> {
    let at = index * ATTRIBUTE_WORDS + LOW_WORD;
    return bitcast<vec3<f32>>(vec3<u32>(chosen[at], chosen[at + 1u], chosen[at + 2u]));
}
