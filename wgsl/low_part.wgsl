// What the f32 centre of a surfel or node of a tree leaves out, world units: it comes with its attributes (center_doubled.wgsl).

fn low_part(record: u32) -> vec3<f32> {
    let at = record * TREE_WORDS + LOW_WORD;
    return bitcast<vec3<f32>>(vec3<u32>(tree_attributes[at], tree_attributes[at + 1u], tree_attributes[at + 2u]));
}
