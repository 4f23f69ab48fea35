// Kernels read and write records four 32-bit words at a time, and read surfels as structs of nine
// words. Same interface as words_long.wgsl.
// #import layout::{Surfel}

alias Words = vec4<u32>;

fn words(each: vec4<u32>) -> Words {
    return each;
}

fn each_word(four: Words) -> vec4<u32> {
    return four;
}

@group(0) @binding(2) var<storage, read> surfels: array<Surfel>;

fn surfel_at(index: u32) -> Surfel {
    return surfels[index];
}

fn surfels_held() -> u32 {
    return arrayLength(&surfels);
}
