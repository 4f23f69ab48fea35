// Blended sums of up to twelve channels, in three targets. Same interface as raster_targets_1.wgsl.
// #import accumulator_raster::{four_terms}

@group(0) @binding(20) var sums_0: texture_2d<f32>;
@group(0) @binding(17) var sums_1: texture_2d<f32>;
@group(0) @binding(18) var sums_2: texture_2d<f32>;

struct Targets {
    @location(0) sums_0: vec4<f32>,
    @location(1) sums_1: vec4<f32>,
    @location(2) sums_2: vec4<f32>,
}

fn targets() -> Targets {
    return Targets(four_terms(0u), four_terms(4u), four_terms(8u));
}

fn target_at(place: vec2<u32>, index: u32) -> vec4<f32> {
    switch index {
        case 0u: {
            return textureLoad(sums_0, place, 0);
        }
        case 1u: {
            return textureLoad(sums_1, place, 0);
        }
        default: {
            return textureLoad(sums_2, place, 0);
        }
    }
}

// The targets and the fragment's own depth.
struct Seen {
    @location(0) sums_0: vec4<f32>,
    @location(1) sums_1: vec4<f32>,
    @location(2) sums_2: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

fn seen(depth: f32) -> Seen {
    return Seen(four_terms(0u), four_terms(4u), four_terms(8u), depth);
}
