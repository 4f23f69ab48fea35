// The first stage of triangles: projects every vertex to a corner, once for all its triangles. One
// invocation per vertex.
// Twin: src/passes/triangles.rs.
// #import corner_*::{corner_of}
// #import double::{Double}
// #import layout::{WORKGROUP, hold_view, linear_index}
// #import project::{rotate}
// #import vertex|vertex_doubled::{relative_vertex}

// World units relative to the scene's origin: three words per vertex (vertex.wgsl), or six
// (vertex_doubled.wgsl).
@group(0) @binding(52) var<storage, read> vertices: array<f32>;
// The fields of Corner, in their order.
@group(0) @binding(53) var<storage, read_write> corners_seen: array<array<f32, 9>>;

// A vertex in the image. Relative to the image point p it is (x, y) - p w, from which the edges of
// its triangles are computed.
struct Corner {
    x: Double,
    y: Double,
    w: Double,
    // Camera-space z, device units.
    depth: Double,
    // The factor that converts the area opposite the corner to its barycentric coordinate, not
    // normalised.
    share: f32,
}

@compute @workgroup_size(WORKGROUP)
fn see_corners(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
) {
    hold_view();
    let vertex = linear_index(workgroup, workgroups, local);
    if (vertex >= arrayLength(&corners_seen)) {
        return;
    }
    let c = corner_of(rotate(relative_vertex(vertex)));
    corners_seen[vertex] =
        array<f32, 9>(c.x.high, c.x.low, c.y.high, c.y.low, c.w.high, c.w.low, c.depth.high, c.depth.low, c.share);
}
