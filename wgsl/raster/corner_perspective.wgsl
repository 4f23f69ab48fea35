// Corners of triangles whose images come from rays that start at the eye (corner_pinhole.wgsl,
// corner_lens.wgsl). Same interface as corner_orthographic.wgsl.
// Twin: src/passes/triangles.rs.
// #import corners::{Corner}
// #import double::{Double}
// #import layout::{held}
// #import rows::{single}
// #import triangles::{Triangle}

// Whether the corner has an image.
fn is_before(corner: Corner) -> bool {
    return corner.depth.high >= held.near;
}

// The factor from the corner's position to its homogeneous image: one over its share.
fn homogeneous_depth(corner: Corner) -> Double {
    if (is_before(corner)) {
        return corner.depth;
    }
    return single(1.0);
}

// The depth for the rasteriser, which divides it by the corner's depth: 1 at the near depth, 0 at
// infinity.
fn clip_depth(corner: Corner) -> f32 {
    return held.near;
}

// The barycentric area of a pixel: the determinant of the change of the triangle's barycentric
// coordinates per column and row. `depth` is the triangle's depth there, and `of_depth` the sum of
// its corners' shared depths weighted by the areas of the opposite edges.
fn spread_of_parts(triangle: Triangle, depth: f32, of_depth: f32) -> f32 {
    let a = depth / homogeneous_depth(triangle.a).high;
    let b = depth / homogeneous_depth(triangle.b).high;
    let c = depth / homogeneous_depth(triangle.c).high;
    return a * b * c / of_depth;
}

// The corner's depth times its share.
fn shared_depth(corner: Corner) -> Double {
    if (is_before(corner)) {
        return single(1.0);
    }
    return corner.depth;
}
