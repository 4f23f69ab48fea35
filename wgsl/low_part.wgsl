// What the f32 centre of a surfel or node of a tree leaves out, world units: it comes with its attributes (center_doubled.wgsl), which are bound as what
// `chosen` is behind, as no buffer can be bound twice where it is written.

fn low_part(index: u32) -> vec3<f32> {
    let at = index * ATTRIBUTE_WORDS + LOW_WORD;
    return bitcast<vec3<f32>>(vec3<u32>(chosen[at], chosen[at + 1u], chosen[at + 2u]));
}
