// Vertices of triangles where f32 has too few digits for some corners: a mesh far from the scene's
// origin, or a needle. A vertex has six words: the position as f32, then the part that f32 leaves
// out. Same interface as vertex.wgsl. Twin: Triangles::place in src/scene/triangles.rs.
// All loops end, by 1 of src/gpu/loops.rs: 0x4ea43420cf41c34b
// #import corners::{vertices}
// #import double::{Double, sum, two_sum}
// #import layout::{held}
// #import rows::{minor}

// The position relative to the eye, device units. Where the leading parts cancel, their difference
// may be smaller than the trailing parts, so both are added in doubled precision.
fn relative_vertex(vertex: u32) -> array<Double, 3> {
    var relative: array<Double, 3>;
    for (var i = 0u; i < 3u; i++) {
        let d = two_sum(vertices[6u * vertex + i] * held.unit, -held.eye[i]);
        let low = two_sum(vertices[6u * vertex + 3u + i] * held.unit, -held.eye_low[i]);
        relative[i] = sum(d, low);
    }
    return relative;
}

// The vector from one vertex to another, device units.
fn edge_between(from_: u32, to: u32) -> array<Double, 3> {
    var edge: array<Double, 3>;
    for (var i = 0u; i < 3u; i++) {
        let d = two_sum(vertices[6u * to + i] * held.unit, -vertices[6u * from_ + i] * held.unit);
        let low = two_sum(vertices[6u * to + 3u + i] * held.unit, -vertices[6u * from_ + 3u + i] * held.unit);
        edge[i] = sum(d, low);
    }
    return edge;
}

// The normal of the triangle's plane, not normalised. The edges are scaled to about 1, so that no
// product underflows for a small triangle.
fn facet_of(numbers: vec3<u32>) -> vec3<f32> {
    let b = near_one(edge_between(numbers.x, numbers.y));
    let c = near_one(edge_between(numbers.x, numbers.z));
    return vec3<f32>(
        minor(b[1], c[2], b[2], c[1]).high,
        minor(b[2], c[0], b[0], c[2]).high,
        minor(b[0], c[1], b[1], c[0]).high,
    );
}

// Scales an edge by a power of two, so that its largest coordinate is in [1, 2).
fn near_one(edge: array<Double, 3>) -> array<Double, 3> {
    let largest = max(max(abs(edge[0].high), abs(edge[1].high)), max(abs(edge[2].high), 1e-30));
    let scale = bitcast<f32>(0x7f000000u - (bitcast<u32>(largest) & 0x7f800000u));
    var scaled: array<Double, 3>;
    for (var i = 0u; i < 3u; i++) {
        scaled[i] = Double(edge[i].high * scale, edge[i].low * scale);
    }
    return scaled;
}
