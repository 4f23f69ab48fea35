// Triangles, their first stage: every vertex becomes a corner, once, whichever triangles it is of. One invocation a vertex.
// Twin: src/passes/triangles.rs.

// World units relative to the scene's origin: three words a vertex (vertex.wgsl), or six
// (vertex_doubled.wgsl).
@group(0) @binding(52) var<storage, read> vertices: array<f32>;
// The numbers of a Corner, in their order.
@group(0) @binding(53) var<storage, read_write> corners_seen: array<array<f32, 9>>;

// A vertex in the image. Relative to the point p of the image it is (x, y) - p w, and that is what its triangles' edges are made of.
struct Corner {
    x: Double,
    y: Double,
    w: Double,
    // Camera-space z, device units.
    depth: Double,
    // What weighs its part of a triangle's pixel beside the part's area.
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
