// Surfels whose attributes store a normal, which may differ from that of the disk: a disk lies in a
// triangle's plane, but is lit as the smooth surface that the triangles approximate. Same interface
// as normal_plane.wgsl.
// #import attributes::{attribute_word}

// The first of the normal's three words in a surfel's attributes: world space, unit length.
override NORMAL_WORD: u32;

fn surfel_normal(index: u32) -> vec3<f32> {
    return vec3<f32>(
        bitcast<f32>(attribute_word(index, NORMAL_WORD)),
        bitcast<f32>(attribute_word(index, NORMAL_WORD + 1u)),
        bitcast<f32>(attribute_word(index, NORMAL_WORD + 2u)),
    );
}
