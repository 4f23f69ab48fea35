// Blended sums of up to eight channels, in two targets. Same interface as raster_targets_1.wgsl.
// #import accumulator_raster::{four_terms}

@group(0) @binding(20) var sums_0: texture_2d<f32>;
@group(0) @binding(17) var sums_1: texture_2d<f32>;

struct Targets {
    @location(0) sums_0: vec4<f32>,
    @location(1) sums_1: vec4<f32>,
}

fn targets() -> Targets {
    return Targets(four_terms(0u), four_terms(4u));
}

fn target_at(place: vec2<u32>, index: u32) -> vec4<f32> {
    switch index {
        case 0u: {
            return textureLoad(sums_0, place, 0);
        }
        default: {
            return textureLoad(sums_1, place, 0);
        }
    }
}

// The targets and the fragment's own depth.
struct Seen {
    @location(0) sums_0: vec4<f32>,
    @location(1) sums_1: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

fn seen(depth: f32) -> Seen {
    return Seen(four_terms(0u), four_terms(4u), depth);
}
