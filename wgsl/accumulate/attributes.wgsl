// The attributes of surfels beside their shape. Each surfel has a record of as many words as the
// render needs, laid out by the host (src/plan/surfel.rs). So one more attribute takes words but no
// further binding.

override ATTRIBUTE_WORDS: u32;

@group(0) @binding(11) var<storage, read> attributes: array<u32>;

fn attribute_word(index: u32, word: u32) -> u32 {
    return attributes[index * ATTRIBUTE_WORDS + word];
}

// Reads four floats from `word` on.
fn attribute_vector(index: u32, word: u32) -> vec4<f32> {
    let at = index * ATTRIBUTE_WORDS + word;
    return bitcast<vec4<f32>>(vec4<u32>(attributes[at], attributes[at + 1u], attributes[at + 2u], attributes[at + 3u]));
}
