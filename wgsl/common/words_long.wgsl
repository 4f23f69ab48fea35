// Records and surfels read and written by 64 bits at a time, on adapters with 64-bit integers: half
// as many accesses for the same bits. Software adapters pay for each access, not for its bytes.
// Same interface as words.wgsl.
// #import layout::{Surfel}

alias Words = vec2<u64>;

fn low_word(long: u64) -> u32 {
    return u32(long & 0xfffffffflu);
}

fn high_word(long: u64) -> u32 {
    return u32(long >> 32u);
}

fn words(each: vec4<u32>) -> Words {
    return (vec2<u64>(each.yw) << vec2<u32>(32u)) | vec2<u64>(each.xz);
}

fn each_word(four: Words) -> vec4<u32> {
    return vec4<u32>(low_word(four.x), high_word(four.x), low_word(four.y), high_word(four.y));
}

// Each u64 holds two 32-bit words of the surfels; the host pads the last u64.
@group(0) @binding(2) var<storage, read> surfels: array<u64>;

// Two consecutive f32 that start in the low half of `first`, or in its high half if `odd`.
fn shifted(first: u64, second: u64, odd: bool) -> vec2<f32> {
    let low = select(low_word(first), high_word(first), odd);
    let high = select(high_word(first), low_word(second), odd);
    return vec2<f32>(bitcast<f32>(low), bitcast<f32>(high));
}

// A surfel has nine words, so every other surfel starts in the middle of a 64-bit word.
fn surfel_at(index: u32) -> Surfel {
    let odd = (index & 1u) == 1u;
    let at = (9u * index) >> 1u;
    let first = surfels[at];
    let second = surfels[at + 1u];
    let third = surfels[at + 2u];
    let fourth = surfels[at + 3u];
    let fifth = surfels[at + 4u];
    let a = shifted(first, second, odd);
    let b = shifted(second, third, odd);
    let c = shifted(third, fourth, odd);
    let d = shifted(fourth, fifth, odd);
    let last = bitcast<f32>(select(low_word(fifth), high_word(fifth), odd));
    return Surfel(array<f32, 3>(a.x, a.y, b.x), array<f32, 3>(b.y, c.x, c.y), array<f32, 3>(d.x, d.y, last));
}

fn surfels_held() -> u32 {
    return arrayLength(&surfels) * 2u / 9u;
}
