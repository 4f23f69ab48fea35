// Vertices of triangles, as three f32. Same interface as vertex_doubled.wgsl.
// Twin: src/passes/triangles.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x311a93ed066321eb
// #import corners::{vertices}
// #import double::{Double, quick_two_sum, two_sum}
// #import layout::{held}
// #import vectors::{cross3}

// The position relative to the eye, device units.
fn relative_vertex(vertex: u32) -> array<Double, 3> {
    var relative: array<Double, 3>;
    for (var i = 0u; i < 3u; i++) {
        let d = two_sum(vertices[3u * vertex + i] * held.unit, -held.eye[i]);
        relative[i] = quick_two_sum(d.high, d.low - held.eye_low[i]);
    }
    return relative;
}

fn vertex_at(number: u32) -> vec3<f32> {
    return vec3<f32>(vertices[3u * number], vertices[3u * number + 1u], vertices[3u * number + 2u]);
}

// The normal of the triangle's plane, not normalised.
fn facet_of(numbers: vec3<u32>) -> vec3<f32> {
    let a = vertex_at(numbers.x);
    return cross3((vertex_at(numbers.y) - a) * held.unit, (vertex_at(numbers.z) - a) * held.unit);
}
