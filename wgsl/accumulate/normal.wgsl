// Sums of normals. Each normal is turned toward the viewer before it is summed, because the normals
// of the front and the back of a thin part would cancel. It is also mapped from [-1, 1] to [0, 1].
// Twin: src/passes/accumulate.rs, src/passes/resolve.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x5f4eb9a33ee59bf8
// #import *::{Term, add, add_pair, sum_at, term}
// #import side::{side_of}
// #import vectors::{dot3}

override NORMAL_CHANNEL: u32;
// Whether normals are turned toward the viewer. False where a pixel blends both sides of a surface,
// with normals as they are given (Sides::Both in src/plan/needs.rs). The rasteriser's own depth
// test (src/passes/raster.rs) and order-independent transparency do so.
override TURNS: bool;

fn accumulate_normal(pixel: u32, weight: Term, normal: vec3<f32>) {
    add_pair(pixel, NORMAL_CHANNEL, term(weight, normal.x), term(weight, normal.y));
    add(pixel, NORMAL_CHANNEL + 2u, term(weight, normal.z));
}

// The normalised mean, turned to the side that the nearest fragment shows; 0 where opposite normals
// cancel.
fn resolve_normal(pixel: u32, weight: f32, front: f32) -> vec3<f32> {
    var mean: vec3<f32>;
    for (var k = 0u; k < 3u; k++) {
        mean[k] = sum_at(pixel, NORMAL_CHANNEL + k) / weight * 2.0 - 1.0;
    }
    let length_2 = dot3(mean, mean);
    return select(vec3<f32>(0.0), mean * (side_of(front) * inverseSqrt(length_2)), length_2 > 1e-12);
}
