// Blended sums of up to four channels, in one target.
// #import accumulator_raster::{four_terms}

@group(0) @binding(20) var sums_0: texture_2d<f32>;

struct Targets {
    @location(0) sums_0: vec4<f32>,
}

fn targets() -> Targets {
    return Targets(four_terms(0u));
}

fn target_at(place: vec2<u32>, index: u32) -> vec4<f32> {
    return textureLoad(sums_0, place, 0);
}

// The targets and the fragment's own depth.
struct Seen {
    @location(0) sums_0: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

fn seen(depth: f32) -> Seen {
    return Seen(four_terms(0u), depth);
}
