// What the f32 centre of a surfel or node of a tree leaves out, world units: it comes with its attributes (center_doubled.wgsl).

fn low_part(index: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(vec3<u32>(
        attribute_word(index, LOW_WORD),
        attribute_word(index, LOW_WORD + 1u),
        attribute_word(index, LOW_WORD + 2u),
    ));
}
