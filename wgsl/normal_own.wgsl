// A surfel's normal where it is another one than its disk's: a disk lies in a triangle's plane, and light sees the surface that the
// triangles stand for.

// The first of three words of a surfel's attributes: world space, unit.
override NORMAL_WORD: u32;

fn surfel_normal(index: u32) -> vec3<f32> {
    return vec3<f32>(
        bitcast<f32>(attribute_word(index, NORMAL_WORD)),
        bitcast<f32>(attribute_word(index, NORMAL_WORD + 1u)),
        bitcast<f32>(attribute_word(index, NORMAL_WORD + 2u)),
    );
}
